"""`compd check`: is this configuration a machine?"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from compd.configuration import Configuration
    from compd.errors import Problem


def check(
    config: Annotated[Path | None, typer.Argument(help="The machine's configuration (YAML).")] = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema for editors and stop.")] = False,
    drivers: Annotated[bool, typer.Option("--drivers", help="List the installed gauge drivers and stop.")] = False,
) -> None:
    """Check a configuration; report every error at once, with file, line, key, value, what is allowed, next step."""
    if schema:
        from compd.configuration.schema import json_schema

        typer.echo(json.dumps(json_schema(), indent=2))
        return
    if drivers:
        _list_drivers()
        return
    if config is None:
        raise typer.BadParameter("name a configuration file, e.g. config/tripod-cmm.yaml")
    from compd.configuration import load
    from compd.machine_builder import build_model

    configuration = load(config)
    build_model(configuration.geometry, configuration.wiring)
    for warning in (*configuration.warnings, *print_line_budgets(configuration)):
        typer.echo(f"warning: {warning}")
    wiring = configuration.wiring
    own_process = configuration.acquisition.own_process
    processes = f" (polled in processes of their own: {', '.join(own_process)})" if own_process else ""
    typer.echo(
        f"{config}: {configuration.machine} is complete: {configuration.geometry.links} links, "
        f"{len(wiring.joint)} joint and {len(wiring.frame)} frame comparators, {len(wiring.quantities)} quantities, "
        f"{len(configuration.gauges)} gauges on {len(configuration.lines)} lines{processes}; "
        f"hash {configuration.config_hash}"
    )


def _list_drivers() -> None:
    from rich.console import Console
    from rich.table import Table

    from compd.plugins import GAUGES, load, names

    table = Table("driver", "needs a line that carries", "what it is")
    table.columns[0].no_wrap = True
    for name in names(GAUGES):
        driver = load(GAUGES, name, name)
        table.add_row(name, driver.line_kind, (driver.__doc__ or "").strip().splitlines()[0])
    Console().print(table)


def print_line_budgets(configuration: Configuration) -> list[Problem]:
    """Print bytes, milliseconds and rate per line; the warnings that follow."""
    from rich.console import Console
    from rich.table import Table

    from compd.commissioning.line_budget import budget_warnings, line_budgets
    from compd.report.terminal_table import keep_words_whole

    budgets = line_budgets(configuration)
    table = Table(
        "line",
        "gauges",
        "exchanges",
        "bytes",
        "ms a round",
        "ms, 10 ms turnaround",
        "rate, Hz",
        title="What the lines can carry",
        title_justify="left",
    )
    for column in table.columns[1:]:
        column.justify = "right"
    table.columns[-1].no_wrap = True
    for budget in budgets:
        table.add_row(
            budget.name,
            str(budget.gauges),
            str(budget.exchanges),
            str(budget.bytes) if budget.known else "?",
            f"{budget.ideal_s * 1e3:.1f}" if budget.known else "?",
            f"{budget.usual_s * 1e3:.1f}" if budget.known else "?",
            _rates(budget.usual_hz, budget.ideal_hz),
        )
    console = Console()
    console.print(keep_words_whole(table, console.width))
    return budget_warnings(configuration, budgets)


def _rates(usual_hz: float, ideal_hz: float) -> str:
    return "?" if math.isnan(usual_hz) else f"{usual_hz:.3g} to {ideal_hz:.3g}"
