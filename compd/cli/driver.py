"""`compd driver test`: does a driver ever give a wrong number?"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from compd.commissioning.conformance.cases import Result
    from compd.commissioning.conformance.report import Driver

app = typer.Typer(no_args_is_help=True, help="Gauge drivers.")


@app.callback()
def _drivers() -> None:
    """Gauge drivers."""


@app.command("test")
def try_on_wires(
    name: Annotated[
        str | None, typer.Argument(help="Entry point, or /absolute/file.py:ClassName; all installed if left out.")
    ] = None,
    options: Annotated[
        Path | None, typer.Option(help="YAML with the gauge's options; the driver's own `sample_options` if left out.")
    ] = None,
    simulator: Annotated[
        str | None, typer.Option(help="Its simulated device: entry point or file; the driver's own if left out.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="In virtual time alone, no ptys or ports.")] = False,
) -> None:
    """Try a driver on wires that go wrong: each fault must give its quality, and the next good reading must be right.

    Exit code 1 if any case fails, or if a driver cannot be tried.
    """
    from compd.commissioning.conformance.report import find
    from compd.errors import PluginError
    from compd.plugins import GAUGES, names

    chosen = _read_options(options) if options else None
    if name is not None:
        failed = _try(find(name, chosen, simulator), quick)
    else:
        failed = 0
        for each in names(GAUGES):
            try:
                driver = find(each)
            except PluginError as error:
                typer.echo(f"\n{error}")
                failed += 1
                continue
            failed += _try(driver, quick)
    raise typer.Exit(1 if failed else 0)


def _try(driver: Driver, quick: bool) -> int:
    """Print each case as it ends, and the table; the number that failed."""
    from compd.commissioning.conformance.report import try_driver

    typer.echo(f"\n{driver.name}, {driver.gauge.line_kind}:")
    found: list[tuple[str, Result]] = []
    for wire, result in try_driver(driver, on_real_wires=not quick):
        wanted = f" [{result.wanted}]" if result.wanted else ""
        typer.echo(f"  {result.verdict:4} {wire:12} {result.case}{wanted}: {result.came}")
        found.append((wire, result))
    _print_table(driver.name, found)
    return sum(result.verdict == "FAIL" for _, result in found)


def _print_table(name: str, found: list[tuple[str, Result]]) -> None:
    from rich.console import Console
    from rich.table import Table

    wires = list(dict.fromkeys(wire for wire, _ in found))
    colours = {"pass": "[green]pass[/]", "FAIL": "[bold red]FAIL[/]", "-": "-"}
    table = Table("case", *wires, title=f"{name} (-: cannot be tried there, see above)", title_justify="left")
    for case in dict.fromkeys(result.case for _, result in found):
        verdicts = {wire: colours[result.verdict] for wire, result in found if result.case == case}
        table.add_row(case, *(verdicts.get(wire, "") for wire in wires))
    Console().print(table)
    failed = sum(result.verdict == "FAIL" for _, result in found)
    typer.echo(f"{name}: {failed} of {len(found)} cases failed" if failed else f"{name}: nothing failed")


def _read_options(path: Path) -> dict[str, Any]:
    from compd.configuration.document import read_document

    data = read_document(path).data
    return {key: value for key, value in data.items() if key not in ("driver", "line")}
