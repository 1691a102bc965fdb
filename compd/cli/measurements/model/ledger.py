"""`compd model ledger`: every step that changed a model, and the falling error."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from compd.cli.option_groups import PageOptions, with_groups

_BAR_WIDTH = 16
# Width of a cell's frame: two spaces and a line.
_CELL_FRAME = 3


@with_groups
def ledger(
    model: Annotated[Path, typer.Argument(metavar="MODEL", help="The model file.")],
    page: PageOptions = PageOptions(),
) -> None:
    """Print every step of a model: the change, its recording, the error before and after."""
    from rich.console import Console
    from rich.table import Table

    from compd.model_file import read_stored
    from compd.report import LEDGER_HEAD, keep_words_whole, ledger_rows

    stored = read_stored(model)
    steps = stored.steps
    console = Console(highlight=False)
    if not steps:
        console.print(f"{model}: no step yet; `compd model add` makes the first")
        return
    units = {step.unit for step in steps}
    shown = [k for k, name in enumerate(LEDGER_HEAD) if name != "unit" or len(units) > 1]
    title = f"{model}: {stored.machine}" + (f"; residuals in {steps[0].unit}" if len(units) == 1 else "")
    columns = [[row[k] for row in ledger_rows(stored)] for k in shown]
    heads = [LEDGER_HEAD[k] for k in shown]
    largest = max(max(step.rms_before_um, step.rms_after_um) for step in steps)
    bars = ["#" * max(1, round(_BAR_WIDTH * step.rms_after_um / largest)) for step in steps]
    widths = [max(map(len, [head, *texts])) for head, texts in zip(heads, columns, strict=True)]
    if sum(widths) + _CELL_FRAME * len(widths) + _BAR_WIDTH + _CELL_FRAME < console.width:
        heads.append("")
        columns.append(bars)
    table = Table(*heads, title=title, title_justify="left")
    for cells in zip(*columns, strict=True):
        table.add_row(*cells)
    console.print(keep_words_whole(table, console.width))
    if page.html is not None:
        from compd.report import write_ledger_page

        page.check()
        write_ledger_page(page.html, stored)
        typer.echo(f"The falling error as a picture: {page.html}")
