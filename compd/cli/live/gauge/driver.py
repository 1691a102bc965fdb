"""`compd gauge test-driver`: check that a driver never delivers a wrong number."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from compd.cli.paths import PathKind

if TYPE_CHECKING:
    from compd.conformance import CaseResult, DriverUnderTest

driver = typer.Typer()


@driver.command("test-driver")
def try_on_wires(
    name: Annotated[
        str | None,
        typer.Argument(help="Entry point, or /absolute/file.py:ClassName; default: all installed ones."),
        PathKind.NAME_OR_FILE,
    ] = None,
    options: Annotated[
        Path | None, typer.Option(help="YAML with the gauge's options; default: the driver's own `sample_options`.")
    ] = None,
    simulator: Annotated[
        str | None,
        typer.Option(help="Its simulated device: entry point or file; default: the driver's own."),
        PathKind.NAME_OR_FILE,
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only in virtual time, without ptys and ports.")] = False,
) -> None:
    """Try a driver on faulty wires: each fault must give its quality, and the next good reading must be right.

    Exit code 1 if any case fails, or if a driver cannot be tried.
    """
    from compd.conformance import driver_under_test
    from compd.errors import PluginError
    from compd.gauge_tools import polled_drivers

    chosen = _read_options(options, name) if options and name else None
    if name is not None:
        failed = _try(driver_under_test(name, chosen, simulator), quick)
    else:
        failed = 0
        for installed in polled_drivers():
            try:
                driver = driver_under_test(installed)
            except PluginError as error:
                typer.echo(f"\n{error}")
                failed += 1
                continue
            failed += _try(driver, quick)
    raise typer.Exit(1 if failed else 0)


def _try(driver: DriverUnderTest, quick: bool) -> int:
    """Print each case as it ends, and the table; return the number of failures."""
    from compd.conformance import run_conformance

    typer.echo(f"\n{driver.name}, {driver.gauge.line_kind}:")
    results: list[tuple[str, CaseResult]] = []
    for wire, result in run_conformance(driver, on_real_wires=not quick):
        required = f" [{result.required}]" if result.required else ""
        typer.echo(f"  {result.verdict:4} {wire:12} {result.case}{required}: {result.observed}")
        results.append((wire, result))
    _print_table(driver.name, results)
    return sum(result.verdict == "FAIL" for _, result in results)


def _print_table(name: str, results: list[tuple[str, CaseResult]]) -> None:
    from rich.console import Console
    from rich.table import Table

    wires = list(dict.fromkeys(wire for wire, _ in results))
    colours = {"pass": "[green]pass[/]", "FAIL": "[bold red]FAIL[/]", "-": "-"}
    table = Table("case", *wires, title=f"{name} (-: cannot be tried there, see above)", title_justify="left")
    for case in dict.fromkeys(result.case for _, result in results):
        verdicts = {wire: colours[result.verdict] for wire, result in results if result.case == case}
        table.add_row(case, *(verdicts.get(wire, "") for wire in wires))
    Console().print(table)
    failed = sum(result.verdict == "FAIL" for _, result in results)
    typer.echo(f"{name}: {failed} of {len(results)} cases failed" if failed else f"{name}: nothing failed")


def _read_options(path: Path, driver: str) -> dict[str, Any]:
    from compd.documents import read_document
    from compd.files import FileKind
    from compd.plugins import GAUGES, load

    keys = load(GAUGES, driver, f"driver {driver}").Options.model_fields
    data = read_document(path, FileKind(f"a file of options of {driver}", frozenset(keys), least=1)).data
    return {key: value for key, value in data.items() if key not in ("driver", "line")}
