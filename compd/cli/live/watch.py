"""`compd watch`: the daemon's setpoints in the terminal, live."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated, Any

import typer
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from compd.cli.waiting import connect_patiently
from compd.client import DEFAULT_ADDRESS, Client
from compd.live.loop.states import State, state_named
from compd.units import UM_PER_MM

_BAR_WIDTH = 21  # odd: one cell is zero
_STATUS_EVERY_S = 1.0
# Setpoints come many times a second; a daemon that says nothing for so long is gone.
_TIMEOUT_S = 5.0


def watch(
    address: Annotated[
        str, typer.Argument(help="The daemon's host:port or Unix socket, or the configuration (YAML) that names one.")
    ] = DEFAULT_ADDRESS,
    rate_hz: Annotated[float, typer.Option(min=0.1, help="Setpoints per second.")] = 10.0,
    count: Annotated[int, typer.Option(min=0, help="Stop after so many setpoints; 0 = until Ctrl-C.")] = 0,
    json_lines: Annotated[bool, typer.Option("--json", help="Print the messages as they come, one per line.")] = False,
) -> None:
    """Watch the daemon: tip, corrections and where they come from, state and reason, ages, loop."""
    with connect_patiently(address, _TIMEOUT_S) as client:
        try:
            if json_lines:
                _print_lines(client, rate_hz, count)
            else:
                _show(client, rate_hz, count)
        except KeyboardInterrupt:
            return


def _print_lines(client: Client, rate_hz: float, count: int) -> None:
    import json

    for number, setpoint in enumerate(client.watch(rate_hz), start=1):
        sys.stdout.write(json.dumps(setpoint) + "\n")
        sys.stdout.flush()
        if number == count:
            return


def _show(client: Client, rate_hz: float, count: int) -> None:
    status = client.status()
    asked_s = status["time_s"]
    with Live(console=Console(), auto_refresh=False) as live:
        for number, setpoint in enumerate(client.watch(rate_hz), start=1):
            if setpoint["time_s"] - asked_s >= _STATUS_EVERY_S:
                status = client.status()
                asked_s = setpoint["time_s"]
            live.update(view(client.version, setpoint, status), refresh=True)
            if number == count:
                return


def view(version: dict[str, Any], setpoint: dict[str, Any], status: dict[str, Any]) -> RenderableType:
    """One picture of the daemon: what a VERSION, a SETPOINT and a STATUS message say."""
    parts: list[RenderableType] = [_headline(version, setpoint)]
    if setpoint["reason"]:
        parts.append(Text(setpoint["reason"], style=state_colour(setpoint["state"])))
    if setpoint["valid"] and state_named(setpoint["state"]) is not None:
        parts += [_position(setpoint), _corrections(setpoint)]
    parts.append(_loop(status))
    if ended := _ended_processes(status):
        parts.append(Text(f"started anew: {ended}", style="yellow"))
    if lost := [gauge for gauge in status["gauges"] if gauge["quality"] != "ok"]:
        parts.append(Text("not good: " + ", ".join(f"{g['channel']} {g['quality']}" for g in lost), style="red"))
    return Group(*parts)


def state_colour(name: str) -> str:
    """Green for ok, yellow for the other valid states, red for the invalid ones and for those of a newer daemon."""
    state = state_named(name)
    if state is None or not state.valid:
        return "red"
    return "green" if state is State.OK else "yellow"


def _headline(version: dict[str, Any], setpoint: dict[str, Any]) -> Text:
    state = setpoint["state"]
    age = f", oldest gauge {setpoint['age_s'] * 1e3:.0f} ms" if "age_s" in setpoint else ""
    return Text.assemble(
        (version["machine"], "bold"),
        "  ",
        (state.upper(), f"bold {state_colour(state)}"),
        f"  {setpoint['mode']}, setpoint {setpoint['seq']}{age}",
    )


def _position(setpoint: dict[str, Any]) -> Table:
    table = Table("", "x", "y", "z", box=None, pad_edge=False)
    tip = "tip_P_mm" if "tip_P_mm" in setpoint else "tip_M_mm"
    table.add_row(f"{tip.removesuffix('_mm')}, mm", *(f"{value:12.5f}" for value in setpoint[tip]))
    frame = setpoint["frame"]
    table.add_row("frame moved, um", *(f"{value * UM_PER_MM:12.2f}" for value in frame["displacement_M_mm"]))
    table.add_row("frame turned, urad", *(f"{value * 1e6:12.2f}" for value in frame["rotation_M_rad"]))
    return table


def _corrections(setpoint: dict[str, Any]) -> Table:
    sources = setpoint["sources_mm"]
    corrections = setpoint["correction_mm"]
    table = Table(
        "link", "length, mm", "correction, um", "", *(f"{name}, um" for name in sources), box=None, pad_edge=False
    )
    for column in table.columns[:3] + table.columns[4:]:
        column.justify = "right"
    largest = max(map(abs, corrections))
    for i, correction in enumerate(corrections):
        table.add_row(
            str(i + 1),
            f"{setpoint['link_length_mm'][i]:.5f}",
            f"{correction * UM_PER_MM:+.2f}",
            bar(correction, largest),
            *(f"{values[i] * UM_PER_MM:+.2f}" for values in sources.values()),
        )
    return table


def bar(value: float, largest: float) -> Text:
    """`value` as a bar from the middle, as long as its share of `largest`."""
    half = _BAR_WIDTH // 2
    length = round(half * abs(value) / largest) if largest else 0
    left, right = ("█" * length).rjust(half), ("█" * length).ljust(half)
    return Text((left if value < 0 else " " * half) + "│" + (right if value >= 0 else " " * half), style="cyan")


def _loop(status: dict[str, Any]) -> Text:
    loop = status["loop"]
    parts: Sequence[str] = [
        f"loop {loop['rate_hz']:g} Hz",
        f"{loop['missed_cycles']} missed",
        f"period {loop['period_mean_ms']:.4f} ± {loop['period_deviation_ms']:.4f} ms"
        if "period_mean_ms" in loop
        else "",
        f"late {loop['lateness_median_us']:g} us (p99 {loop['lateness_p99_us']:g})"
        if "lateness_median_us" in loop
        else "",
        f"cycle {loop['cycle_median_us']:g} us" if "cycle_median_us" in loop else "",
    ]
    return Text(", ".join(filter(None, parts)), style="dim")


def _ended_processes(status: dict[str, Any]) -> str:
    """The daemon's processes that have ended and were started anew; "" where none has."""
    processes = status.get("processes", {})  # a daemon of 0.2.0 has none
    return "; ".join(
        f"{name}, start {process['starts']}, the one before: {process['last_end']}"
        for name, process in processes.items()
        if "last_end" in process
    )
