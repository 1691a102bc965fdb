"""`compd compare`: compare the model with measurements."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from compd.cli.option_groups import PageOptions, with_groups
from compd.cli.options import HoldOption, JsonOption, MachineOption

if TYPE_CHECKING:
    from compd.comparison import Comparison
    from compd.model.effects import FittedEffect

# Most sentences in the terminal.
MAX_SENTENCES = 6


@with_groups
def compare(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING...", help="The recordings: NAME.csv or NAME.parquet, each with NAME.yaml beside it."
        ),
    ],
    machine: MachineOption = None,
    model: Annotated[
        Path | None, typer.Option("--model", help="The model file with fitted effects; default: no effects.")
    ] = None,
    hold: HoldOption = None,
    as_json: JsonOption = False,
    page: PageOptions = PageOptions(),
) -> None:
    """Compare the model with recordings: print residuals, noise floor, contributions and the worst regions.

    Of a recording of more than 200,000 rows a sample is compared, spread evenly; the result says what that leaves
    uncertain.
    """
    from compd.api import compare as compare_recording
    from compd.cli.progress import open_shown
    from compd.errors import CompdError, Problem

    page.check()
    problems: list[Problem] = []
    comparisons: list[Comparison] = []
    for path in recordings:
        try:
            comparisons.append(compare_recording(open_shown(path, machine, hold=hold or ()), model))
        except CompdError as error:
            problems += error.problems
    if problems:
        raise CompdError(list(dict.fromkeys(problems)))
    if page.html is not None:
        from compd.report import write_comparison_page

        write_comparison_page(page.html, comparisons)
    if as_json:
        results = [comparison.as_json() for comparison in comparisons]
        typer.echo(json.dumps(results[0] if len(results) == 1 else {"recordings": results}, indent=1, allow_nan=False))
        return
    print_comparisons(comparisons)
    if page.html is not None:
        typer.echo(f"The same as pictures: {page.html}")


def print_comparisons(comparisons: list[Comparison]) -> None:
    """The result for a person: a table, then sentences."""
    from rich.console import Console
    from rich.table import Table

    from compd.report import name_of, no_trend_text, summary

    console = Console(highlight=False)
    overview = summary(comparisons)
    table = Table(*overview.head)
    for column in table.columns[1:]:
        column.justify = "right"
        column.overflow = "fold"
    for row in overview.rows:
        table.add_row(*row)
    console.print(table)
    for comparison in comparisons:
        if len(comparisons) > 1:
            console.print(f"[bold]{name_of(comparison)}[/]")
        console.print(comparison.verdict)
        console.print(f"Noise floor: {comparison.floor.how}.")
        if comparison.floor.contradiction:
            console.print(f"Check: {comparison.floor.contradiction}.")
        if not comparison.trends:
            console.print(f"Where it fails: {no_trend_text(comparison)}.")
        for trend in comparison.trends[:MAX_SENTENCES]:
            console.print(f"  - {trend.text}")
        if len(comparison.trends) > MAX_SENTENCES:
            console.print(f"  and {len(comparison.trends) - MAX_SENTENCES} weaker ones (--json and --html have all)")
        for fault in comparison.faults:
            console.print(f"Look: {fault.text}")
        for why, count in comparison.left_out.items():
            console.print(f"{count} rows left out: {why}")
        sidecar = comparison.aligned.recording.sidecar
        if sidecar.quantities_at_zero is None and not sidecar.external and any(map(_is_measured, comparison.fitted)):
            console.print(f"Effects count from {sidecar.counts_from}.")
        if comparison.basis:
            console.print(comparison.basis)


def _is_measured(fitted: FittedEffect) -> bool:
    from compd.model.effects import is_measured

    return is_measured(fitted.effect)
