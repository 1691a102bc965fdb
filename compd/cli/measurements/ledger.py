"""`compd ledger`: every step that changed a model, and the falling error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compd.cli.options import OverwriteOption


def ledger(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="The model file.")],
    html: Annotated[Path | None, typer.Option("--html", help="Draw the falling error into this page.")] = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Print every step that changed a model: what, on which recording, the error before and after."""
    from rich.console import Console
    from rich.table import Table

    from compd.model_document import read_stored
    from compd.report.ledger_page import LEDGER_HEAD, ledger_rows, write_ledger_page
    from compd.report.page import check_page_path

    stored = read_stored(model)
    steps = stored.steps
    console = Console(highlight=False)
    if not steps:
        console.print(f"{model}: no step yet; `compd effect add` makes the first")
        return
    largest = max(max(step.rms_before_um, step.rms_after_um) for step in steps)
    table = Table(*LEDGER_HEAD, "", title=f"{model}: {stored.machine}", title_justify="left")
    for column in table.columns[1:3]:
        column.overflow = "fold"  # names are to be copied whole
    for column in table.columns[3:-1]:
        column.no_wrap = True  # no number, unit or date is cut
    for row, step in zip(ledger_rows(stored), steps, strict=True):
        table.add_row(*row, "#" * max(1, round(16 * step.rms_after_um / largest)))
    console.print(table)
    if html is not None:
        check_page_path(html, overwrite)
        write_ledger_page(html, stored)
        typer.echo(f"The falling error as a picture: {html}")
