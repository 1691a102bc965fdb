"""`compd watch`: the daemon's setpoints in the terminal, live."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from compd.cli.options import DEFAULT_SOCKET, DaemonOption
from compd.cli.waiting import connect_patiently
from compd.client import Client, connect
from compd.clock import Clock, MonotonicClock
from compd.commissioning import warnings_of
from compd.errors import CompdError
from compd.setpoint_states import State, state_named
from compd.units import UM_PER_MM

_BAR_WIDTH = 21  # odd: one cell is zero
# Least correction (mm) of a full bar, so that noise shows no bar.
_MIN_FULL_BAR_MM = 1e-3
# Sources of the correction with a column in the table of the links; all others are effects with rows of their own.
_OWN_COLUMN = ("joints", "frame")
_STATUS_EVERY_S = 1.0
# Least rate (Hz) of read setpoints, at which silence is noticed faster than by eye; and the periods that may pass
# without one.
_MIN_RATE_HZ = 40.0
_PERIODS = 3.0
_LOOK_EVERY_S = 0.1
_END_WITHIN_S = 0.5


def watch(
    daemon: DaemonOption = DEFAULT_SOCKET,
    rate_hz: Annotated[float, typer.Option(min=0.1, help="Setpoints per second.")] = 10.0,
    count: Annotated[int, typer.Option(min=0, help="Stop after this many setpoints; 0 = until Ctrl-C.")] = 0,
    json_lines: Annotated[bool, typer.Option("--json", help="Print the received messages, one per line.")] = False,
    token_file: Annotated[
        Path | None, typer.Option(help="File with the daemon's token, if it requires one from TCP clients.")
    ] = None,
) -> None:
    """Watch the daemon: tip, corrections with their sources, state and reason, ages, loop."""
    token = None if token_file is None else token_file.read_text(encoding="utf-8")
    with connect_patiently(daemon, lambda path: connect(path, token=token)) as client:
        try:
            if json_lines:
                _print_lines(client, rate_hz, count)
            else:
                _show(client, rate_hz, count, same_clock=":" not in daemon)
        except KeyboardInterrupt:
            return


def _print_lines(client: Client, rate_hz: float, count: int) -> None:
    import json

    for number, setpoint in enumerate(client.watch(rate_hz), start=1):
        sys.stdout.write(json.dumps(setpoint) + "\n")
        sys.stdout.flush()
        if number == count:
            return


class NewestSetpoint:
    """The newest setpoint of a client and the daemon's state, followed by a thread of its own.

    A setpoint is shown no longer than its `valid_until`: whatever has stopped, what looks alive is alive.
    """

    def __init__(self, client: Client, rate_hz: float, clock: Clock, same_clock: bool) -> None:
        """`rate_hz`: at which the picture is to change; setpoints are read more often, so that a silence shows.
        `same_clock`: whether `clock` is the daemon's, on its own computer."""
        self._client = client
        self._rate_hz = max(rate_hz, _MIN_RATE_HZ)
        self._clock = clock
        self._same_clock = same_clock
        self._change = threading.Condition()
        self._setpoint: dict[str, Any] | None = None
        self._status: dict[str, Any] = {}
        self._expires_s = math.inf
        self._error: CompdError | None = None
        self._ended = False
        self._thread = threading.Thread(target=self._follow, name="watch", daemon=True)
        self._thread.start()

    def picture(self) -> RenderableType | None:
        """The present state; None before the first setpoint."""
        with self._change:
            if self._setpoint is None:
                return None
            return view(self._client.version, self._setpoint, self._status, self._late_s())

    @property
    def has_expired(self) -> bool:
        """Whether the newest setpoint has expired."""
        with self._change:
            return self._late_s() is not None

    def _late_s(self) -> float | None:
        late_s = self._clock.monotonic() - self._expires_s
        return late_s if late_s >= 0 else None

    def wait(self, timeout_s: float) -> None:
        """Until the connection is lost, or `timeout_s` seconds. Raises the DaemonError with which it was lost."""
        with self._change:
            if self._error is None:
                self._change.wait(timeout_s)
            if self._error is not None:
                raise self._error

    def end(self) -> None:
        """Stop following; the client may be closed then."""
        self._ended = True
        self._thread.join(_END_WITHIN_S)

    def _follow(self) -> None:
        try:
            status = self._client.status()
            asked_s = status["time_s"]
            for setpoint in self._client.watch(self._rate_hz):
                if setpoint["time_s"] - asked_s >= _STATUS_EVERY_S:
                    status = self._client.status()
                    asked_s = setpoint["time_s"]
                rate_hz = min(self._rate_hz, status["loop"]["rate_hz"])
                lasts_s = max(setpoint["valid_until"] - setpoint["time_s"], _PERIODS / rate_hz)
                expires_s = self._clock.monotonic() + lasts_s
                if self._same_clock and setpoint["valid"]:  # it may be old: this program was suspended
                    expires_s = min(expires_s, setpoint["valid_until"])
                with self._change:
                    self._setpoint, self._status, self._expires_s = setpoint, status, expires_s
                if self._ended:
                    return
        except ValueError:  # the daemon stands still, and the client was closed meanwhile
            if not self._ended:
                raise
        except CompdError as error:
            with self._change:
                self._error, self._expires_s = error, min(self._expires_s, self._clock.monotonic())
                self._change.notify_all()


def _show(client: Client, rate_hz: float, count: int, same_clock: bool) -> None:
    clock = MonotonicClock()
    newest = NewestSetpoint(client, rate_hz, clock, same_clock)
    shown, due_s = 0, clock.monotonic()
    console = Console()
    with Live(console=console, auto_refresh=False) as live:
        try:
            while not count or shown < count:
                newest.wait(min(1 / rate_hz, _LOOK_EVERY_S))
                is_due, has_expired = clock.monotonic() >= due_s, newest.has_expired
                if (is_due or has_expired) and (picture := newest.picture()) is not None:
                    live.update(picture, refresh=True)
                    shown += is_due and not has_expired
                    due_s += 1 / rate_hz if is_due else 0.0
        except CompdError:
            if (picture := newest.picture()) is not None:
                live.update(picture, refresh=True)  # leave no number on the screen
            raise
        finally:
            newest.end()
    if not console.is_terminal:
        console.print()  # `Live` leaves the last line open


def view(
    version: dict[str, Any], setpoint: dict[str, Any], status: dict[str, Any], late_s: float | None = None
) -> RenderableType:
    """One picture of the daemon from a VERSION, a SETPOINT and a STATUS message.

    late_s : how long ago the setpoint expired, and none came after it, s; nothing of it is shown then.
    """
    if late_s is not None:
        return Text.assemble(
            (version["machine"], "bold"),
            "  ",
            ("NO SETPOINT", "bold red"),
            f"  the last one, {setpoint['seq']}, has expired {max(late_s, 0.1):.1f} s ago",
            ("\nthe daemon, its computer or the network has stopped", "red"),
        )
    parts: list[RenderableType] = [_headline(version, setpoint)]
    if setpoint["reason"]:
        parts.append(Text(setpoint["reason"], style=state_colour(setpoint["state"])))
    if setpoint["valid"] and state_named(setpoint["state"]) is not None:
        of_pose = "tip_correction_mm" in setpoint
        parts += [_position(setpoint), *([_pose_correction(setpoint)] if of_pose else [])]
        if "correction_mm" in setpoint:
            parts.append(_corrections(setpoint, {} if of_pose else setpoint["sources_mm"]))
        if not of_pose and any(name not in _OWN_COLUMN for name in setpoint["sources_mm"]):
            parts.append(_effects(setpoint))
    parts.append(_loop(status))
    if ended := _ended_processes(status):
        parts.append(Text(f"started anew: {ended}", style="yellow"))
    parts += [Text(f"not good: {text}", style="red") for text in lost_gauges(status["gauges"])]
    parts += [Text(text, style="yellow") for text in warnings_of(status["gauges"])]
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
    skew = f", skew {setpoint['skew_s'] * 1e3:.0f} ms" if "skew_s" in setpoint else ""
    return Text.assemble(
        (version["machine"], "bold"),
        "  ",
        (state.upper(), f"bold {state_colour(state)}"),
        f"  {setpoint['mode']}, setpoint {setpoint['seq']}{age}{skew}",
    )


def _position(setpoint: dict[str, Any]) -> Table:
    table = Table("", "x", "y", "z", box=None, pad_edge=False)
    tip = "tip_P_mm" if "tip_P_mm" in setpoint else "tip_M_mm"
    table.add_row(f"{tip.removesuffix('_mm')}, mm", *(f"{value + 0.0:12.5f}" for value in setpoint[tip]))
    frame = setpoint["frame"]
    table.add_row(
        "frame moved, um", *(f"{_hundredths(value * UM_PER_MM):12.2f}" for value in frame["displacement_M_mm"])
    )
    table.add_row("frame turned, urad", *(f"{_hundredths(value * 1e6):12.2f}" for value in frame["rotation_M_rad"]))
    return table


def _pose_correction(setpoint: dict[str, Any]) -> Table:
    """What is added to the commanded tip, and each cause's part of it."""
    table = Table("", "x", "y", "z", box=None, pad_edge=False)
    table.add_row("tip correction, um", *map(_signed_um, setpoint["tip_correction_mm"]))
    for name, values in setpoint["sources_mm"].items():
        if any(values) or name not in _OWN_COLUMN:
            table.add_row(f"{name}, um", *map(_signed_um, values))
    return table


def _corrections(setpoint: dict[str, Any], sources_mm: Mapping[str, Any]) -> Table:
    """One row per link, with the contributions that every machine may have. sources_mm : of the links."""
    contributions = {name: values for name, values in sources_mm.items() if name in _OWN_COLUMN}
    corrections = setpoint["correction_mm"]
    lengths = setpoint.get("link_length_mm")  # of machines that compd knows
    table = Table(
        "link",
        "length, mm" if lengths else "",
        "correction, um",
        "",
        *(f"{name}, um" for name in contributions),
        box=None,
        pad_edge=False,
    )
    for column in table.columns[:3] + table.columns[4:]:
        column.justify = "right"
    largest_mm = max(_MIN_FULL_BAR_MM, *map(abs, corrections))
    for i, correction in enumerate(corrections):
        table.add_row(
            str(i + 1),
            f"{lengths[i]:.5f}" if lengths else "",
            _signed_um(correction),
            bar(correction, largest_mm),
            *(_signed_um(values[i]) for values in contributions.values()),
        )
    return table


def _effects(setpoint: dict[str, Any]) -> Table:
    """One row per effect of the model with its whole name, for any number of links."""
    links = range(1, len(setpoint["correction_mm"]) + 1)
    table = Table(
        "effect, um", *(f"link {number}" for number in links), box=None, pad_edge=False, collapse_padding=True
    )
    table.columns[0].overflow = "fold"
    for column in table.columns[1:]:
        column.justify = "right"
        column.no_wrap = True
    for name, values in setpoint["sources_mm"].items():
        if name not in _OWN_COLUMN:
            table.add_row(name, *map(_signed_um, values))
    return table


def _signed_um(value_mm: float) -> str:
    return f"{_hundredths(value_mm * UM_PER_MM):+.2f}"


def _hundredths(value: float) -> float:
    """Rounded to two decimals; never -0."""
    return round(value, 2) + 0.0


def bar(value: float, largest: float) -> Text:
    """`value` as a bar from the middle, as long as its share of `largest`."""
    half = _BAR_WIDTH // 2
    length = round(half * abs(value) / largest) if largest else 0
    left, right = ("█" * length).rjust(half), ("█" * length).ljust(half)
    return Text((left if value < 0 else " " * half) + "│" + (right if value >= 0 else " " * half), style="cyan")


def lost_gauges(gauges: Sequence[dict[str, Any]]) -> list[str]:
    """One text for all channels of a gauge with the same fault: "joints: line_lost (all 9)"."""
    channels: dict[str, list[str]] = {}
    lost: dict[tuple[str, str], list[str]] = {}
    for entry in gauges:
        gauge, _, channel = entry["channel"].partition(".")
        channels.setdefault(gauge, []).append(channel)
        if entry["quality"] != "ok":
            lost.setdefault((gauge, entry["quality"]), []).append(channel)
    texts = []
    for (gauge, quality), names in lost.items():
        if len(names) > 1 and names == channels[gauge]:
            texts.append(f"{gauge}: {quality} (all {len(names)})")
        else:
            texts.append(f"{', '.join(f'{gauge}.{name}' for name in names)}: {quality}")
    return texts


def _loop(status: dict[str, Any]) -> Text:
    loop = status["loop"]
    parts: Sequence[str] = [
        f"loop {loop['rate_hz']:g} Hz",
        f"{loop['missed_cycles']} missed",
        f"period {loop['period_mean_ms']:.3f} ± {loop['period_deviation_ms']:.3f} ms"
        if "period_mean_ms" in loop
        else "",
    ]
    times: Sequence[str] = [
        f"late {loop['lateness_median_us']:g} us (p99 {loop['lateness_p99_us']:g})"
        if "lateness_median_us" in loop
        else "",
        f"cycle {loop['cycle_median_us']:g} us" if "cycle_median_us" in loop else "",
    ]
    lines = [", ".join(filter(None, texts)) for texts in (parts, times)]
    return Text("\n".join(filter(None, lines)), style="dim")


def _ended_processes(status: dict[str, Any]) -> str:
    """The daemon's restarted processes; "" for none."""
    processes = status.get("processes", {})  # a daemon of 0.2.0 has none
    return "; ".join(
        f"{name}, start {process['starts']}, the one before: {process['last_end']}"
        for name, process in processes.items()
        if "last_end" in process
    )
