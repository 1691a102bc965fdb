"""`compd check`: check a machine's configuration."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from compd.commissioning import BelievedJump, FeignedJump, LineBudget
    from compd.configuration import Configuration
    from compd.errors import Problem


def check(
    config: Annotated[Path | None, typer.Argument(help="The machine's configuration (YAML).")] = None,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON Schema for editors and stop.")] = False,
    what_cannot_be_seen: Annotated[
        bool,
        typer.Option("--what-cannot-be-seen", help="Print the undetected faults of the gauges, and their cost."),
    ] = False,
) -> None:
    """Check a configuration; report every error at once with file, line, key, value, allowed values and next step.

    Warnings flag usable but suspicious settings; the exit code stays 0. The rate is compared with the time of a cycle
    on this computer.
    """
    if schema:
        from compd.configuration import json_schema

        typer.echo(json.dumps(json_schema(), indent=2))
        return
    if config is None:
        raise typer.BadParameter("name a configuration file, e.g. config/tripod-cmm.yaml")
    from compd.cli.problems import print_problems
    from compd.commissioning import certain_refusal
    from compd.errors import ConfigurationError
    from compd.machine_check import examine_whole
    from compd.not_measured import not_measured

    examined = examine_whole(config)
    configuration = examined.configuration
    if configuration is None:
        print_problems(examined.warnings, "warning: ")
        raise ConfigurationError(examined.problems)
    if what_cannot_be_seen:
        print_blind_spots(configuration)
        for clause in not_measured(configuration):
            typer.echo(f"Not measured: {clause}.")
        return
    warnings = [
        *configuration.warnings,
        *token_warnings(configuration),
        *print_lines(configuration),
        *_print_cycle(configuration),
    ]
    print_problems(warnings, "warning: ", sys.stdout)
    print_zero(configuration)
    if configuration.external is None:
        print_reach(configuration)
    wiring = configuration.wiring
    for clause in not_measured(configuration):
        typer.echo(f"Not measured: {clause}.")
    own_process = configuration.acquisition.own_process
    processes = f" (polled in processes of their own: {', '.join(own_process)})" if own_process else ""
    typer.echo(
        f"{config}: {configuration.machine} is complete: {configuration.geometry.links} links, "
        f"{len(wiring.scale)} scales, "
        f"{len(wiring.joint)} joint and {len(wiring.frame)} frame comparators, {len(wiring.quantities)} quantities, "
        f"{len(configuration.gauges)} gauges on {len(configuration.lines)} lines{processes}; "
        f"hash {configuration.config_hash}"
    )
    if refusal := certain_refusal(configuration):
        typer.echo(refusal)


def print_zero(configuration: Configuration) -> None:
    """Print the lengths at machine zero for a tape measure."""
    from compd.machine_builder import build_model
    from compd.operation_settings import FRAME_DISTANCES

    if (external := configuration.external) is not None:
        who = "a client" if external.own_class is None else external.kinematics
        typer.echo(f"The pose is given by {who}; compd knows no lengths at machine zero.")
        return
    zero = build_model(configuration.geometry, configuration.wiring).zero
    links = ", ".join(f"{number} {mm:.1f}" for number, mm in enumerate(zero.link_length_mm, start=1))
    rods = ", ".join(f"{name} {mm:.1f}" for name, mm in zip(FRAME_DISTANCES, zero.distances_mm, strict=True))
    rods = f"; rods {rods}" if configuration.geometry.has_frame else ""
    typer.echo(f"Machine zero, for a tape measure, mm between centres of joints: links {links}{rods}.")


def print_reach(configuration: Configuration) -> None:
    """Print the degrees of freedom, how far the machine gets, and the nearest singularity."""
    from compd.machine_builder import build_model
    from compd.machine_reach import machine_reach, reach_lines

    model = build_model(configuration.geometry, configuration.wiring)
    for line in reach_lines(machine_reach(model, configuration.geometry.link_length_mm)):
        typer.echo(line)


def print_blind_spots(configuration: Configuration) -> None:
    """Print the cost of a drift of each length, and the undetected faults."""
    from rich.console import Console
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    from compd.commissioning import BLIND_SPOTS, DRIFT_UM, figures_of, shown_by

    console = Console()
    figures = figures_of(configuration)
    title = f"A drift of {DRIFT_UM:g} um is an error at the tip, um"
    table = Table("length", "gauge", "in CMM mode", "in machine-tool mode", title=title, title_justify="left")
    for column in table.columns[2:]:
        column.justify = "right"
    for drift in figures.drifts:
        table.add_row(drift.length, drift.gauge, f"{drift.cmm_um:.1f}", f"{drift.machine_tool_um:.1f}")
    console.print(table)
    for spot in BLIND_SPOTS:
        console.print(Text(spot.fault[0].upper() + spot.fault[1:], style="bold"))
        for name, text in (
            ("shown by", shown_by(spot, configuration)),
            ("unseen", spot.unseen),
            ("cost", spot.cost(figures)),
        ):
            if text:
                console.print(Padding(Text(f"{name}: {text}"), (0, 0, 0, 4)))


def print_lines(configuration: Configuration) -> list[Problem]:
    """Print the load of the lines and the undetected jumps of their gauges; return the resulting warnings."""
    from compd.commissioning import (
        budget_warnings,
        feigned_jumps,
        jump_warnings,
        line_budgets,
        period_warnings,
        reply_warnings,
        shared_address_warnings,
    )

    budgets = line_budgets(configuration)
    jumps = feigned_jumps(configuration, budgets)
    if budgets:
        _print_budgets(budgets)
    if jumps:
        _print_jumps(jumps)
    return [
        *budget_warnings(configuration, budgets),
        *shared_address_warnings(configuration),
        *period_warnings(configuration),
        *jump_warnings(configuration, jumps),
        *reply_warnings(configuration),
    ]


def _print_cycle(configuration: Configuration) -> list[Problem]:
    """Print the time of a cycle on this computer; return the resulting warning."""
    from compd.commissioning import cycle_warnings, measure_cycle, python_effect_times

    cycle = measure_cycle(configuration)
    typer.echo(
        f"A cycle takes {cycle.median_s * 1e3:.2f} ms on this computer, "
        f"and one is due every {1e3 / configuration.loop.rate_hz:.2f} ms."
    )
    for effect, seconds in python_effect_times(configuration).items():
        typer.echo(f"Effect {effect} is plain Python and takes {seconds * 1e3:.2f} ms of it.")
    return cycle_warnings(configuration, cycle)


def token_warnings(configuration: Configuration) -> list[Problem]:
    """Problems of the token file for the daemon; another user may be unable to check it."""
    from compd.errors import DaemonError
    from compd.live.service import TcpAccess

    try:
        TcpAccess.of(configuration.sockets.tcp)
    except DaemonError as error:
        return list(error.problems)
    return []


def _print_budgets(budgets: Sequence[LineBudget]) -> None:
    """Bytes, milliseconds and rate per line."""
    from rich.console import Console
    from rich.table import Table

    from compd.report import keep_words_whole

    table = Table(
        "line",
        "gauges",
        "exchanges",
        "bytes",
        "ms at best",
        "ms, 10 ms to answer",
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


def _print_jumps(jumps: Sequence[FeignedJump]) -> None:
    """Largest undetected jumps of each length gauge."""
    from rich.console import Console
    from rich.table import Table

    from compd.commissioning import named_together
    from compd.report import keep_words_whole

    title = "Largest jump that is believed of a machine at rest; on the move it is larger"
    table = Table(
        "gauge",
        "measures",
        "ms to the next reading",
        "jump, um",
        "ms, four busy processes",
        "jump, um",
        title=title,
        title_justify="left",
    )
    for column in table.columns[2:]:
        column.justify = "right"
    for jump in jumps:
        cells = [cell for believed in (jump.quiet, jump.busy) for cell in _believed_cells(believed)]
        table.add_row(jump.gauge, named_together(jump.measures), *cells)
    console = Console()
    console.print(keep_words_whole(table, console.width))


def _believed_cells(believed: BelievedJump) -> tuple[str, str]:
    """Milliseconds and micrometres; "?" if unknown."""
    poll = "?" if math.isnan(believed.poll_s) else f"{believed.poll_s * 1e3:.1f}"
    if math.isinf(believed.jump_mm):
        return poll, "any"
    return poll, "?" if math.isnan(believed.jump_mm) else f"{believed.jump_mm * 1e3:.3g}"


def _rates(usual_hz: float, ideal_hz: float) -> str:
    return "?" if math.isnan(usual_hz) else f"{usual_hz:.3g} to {ideal_hz:.3g}"
