"""Replace the release that runs by another one, and go back to the one before."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from compd.client import Message, connect
from compd.clock import Clock, MonotonicClock
from compd.errors import CompdError, DaemonError, Problem
from compd.files import write_files
from compd.installation.installing import check_step
from compd.installation.shipped_units import (
    DAEMON,
    PAGE,
    UNIT_DIRECTORY,
    is_packaged,
    program_problems,
    shipped_file,
    unit_path,
)
from compd.installation.system_command import SystemCommand
from compd.setpoint_states import State, state_named

# Longest wait (s) for the state before: a start takes one or two seconds, and a correction may slew for more.
PATIENCE_S = 30.0
_TIMEOUT_S = 2.0
_LOOK_EVERY_S = 0.02
# Setpoints a second by which the time without valid ones is counted.
_RATE_HZ = 50.0
_SILENT = "no setpoints"


@dataclass(frozen=True)
class Replacement:
    """How the machine came through.

    before, after : states of its setpoints. without_s : longest time without a valid one, s.
    """

    before: str
    after: str
    without_s: float

    @property
    def is_worse(self) -> bool:
        """Whether setpoints are not valid after it, or not ok, and were before."""
        before, after = state_named(self.before), state_named(self.after)
        was_valid, is_valid = (state is not None and state.valid for state in (before, after))
        return (was_valid and not is_valid) or (before is State.OK and after is not State.OK)


def upgrade(socket: str, program: Path, clock: Clock | None = None) -> Replacement:
    """Replace the release that runs by the one of `program`.

    The new release checks the configuration, and compiles what it needs, while the old one goes on. Then the units
    start the new program, and those before are kept beside them. Where the setpoints were valid or ok before and are
    not within `PATIENCE_S`, the old release comes back.

    Parameters
    ----------
    socket : the daemon's Unix socket.
    program : the program ``compd`` of the new release.

    Raises
    ------
    CompdError
        Where nothing is installed, the new release refuses the configuration, a model would be lost with the restart,
        or the machine did not become ok again; the release before runs then, where it was kept.
    """
    clock = clock or MonotonicClock()
    if problems := [*program_problems(program), *_restart_problems(socket)]:
        raise CompdError(problems)
    check_step(program).run()
    if is_packaged(program):
        came = _restart(socket, clock)
        if came.is_worse:
            raise CompdError(_worse(came, "install the version of the package before"))
        return came
    new = {unit: shipped_file(f"{unit}.service", program) for unit in _installed_units()}
    return _exchange(socket, new, clock)


def go_back(socket: str) -> Replacement:
    """Exchange the release that runs with the one before it, which doing it again takes back.

    Raises
    ------
    CompdError
        Where there is none, a model would be lost with the restart, or the machine did not become ok again; the
        release that ran runs then.
    """
    units = _installed_units()
    if problems := [
        *(
            Problem(str(_before(unit)), "there is no release to go back to", next_step="compd service upgrade")
            for unit in units
            if not _before(unit).exists()
        ),
        *_restart_problems(socket),
    ]:
        raise CompdError(problems)
    return _exchange(socket, {unit: _before(unit).read_text("utf-8") for unit in units}, MonotonicClock())


def _restart_problems(socket: str) -> list[Problem]:
    """Why a restart would lose something."""
    unit = unit_path(DAEMON)
    if not unit.exists():
        return [Problem(str(unit), "there is no service", next_step="compd service install MACHINE.yaml")]
    try:
        with connect(socket, _TIMEOUT_S) as client:
            model = client.model()
    except DaemonError:
        return []  # a daemon that does not run loses nothing
    if model["kept"]:
        return []
    return [
        Problem(
            "the model that runs",
            "is lost with a restart",
            value=model["applied"].get("file", "no effects"),
            next_step=model["kept_text"],
        )
    ]


def _installed_units() -> tuple[str, ...]:
    return tuple(unit for unit in (DAEMON, PAGE) if unit_path(unit).exists())


def _before(unit: str) -> Path:
    """Where the unit of the release before is kept; systemd reads no file of that suffix."""
    return UNIT_DIRECTORY / f"{unit}.service.before"


def _exchange(socket: str, new: Mapping[str, str], clock: Clock) -> Replacement:
    old = {unit: unit_path(unit).read_text("utf-8") for unit in new}
    _write(new, old)
    came = _restart(socket, clock)
    if came.is_worse:
        _write(old, new)
        back = _restart(socket, clock, State.OK)
        raise CompdError(_worse(came, f"the release before runs again ({back.after})"))
    return came


def _worse(came: Replacement, next_step: str) -> Problem:
    return Problem(
        "the release that replaced the one before",
        f"did not come as far as the one before within {PATIENCE_S:g} s",
        value=came.after,
        allowed=f"{State.OK}, or {came.before} as before",
        next_step=f"{next_step}; look at `journalctl --unit {DAEMON}`",
    )


def _write(units: Mapping[str, str], before: Mapping[str, str]) -> None:
    kept = {_before(unit): text for unit, text in before.items()}
    own = {UNIT_DIRECTORY / f"{unit}.service": text for unit, text in units.items()}
    write_files(own | kept, 0o644)


def _restart(socket: str, clock: Clock, wanted: str = "") -> Replacement:
    """Restart, and watch until the state is `wanted`, or else the one before, or patience is over."""
    setpoints = _setpoints(socket, clock)
    before = next(setpoints)
    SystemCommand("systemd reads the units", ("systemctl", "daemon-reload")).run()
    # without waiting: a start that fails is tried again for ever
    SystemCommand("start the other release", ("systemctl", "restart", "--no-block", DAEMON)).run()
    wanted = wanted or before.get("state", "")
    state, has_ended, valid_s, without_s = _SILENT, not before, before.get("time_s", math.nan), 0.0
    for setpoint in setpoints:
        state = setpoint.get("state", _SILENT)
        has_ended |= not setpoint
        if setpoint.get("valid"):
            # nan, where none was valid before, is never the larger one
            without_s = max(without_s, setpoint["time_s"] - valid_s)
            valid_s = setpoint["time_s"]
        if has_ended and setpoint and wanted in ("", state):
            break
    # only now: it would take the processor while the daemon starts
    if PAGE in _installed_units():
        SystemCommand("and its page, where it runs", ("systemctl", "try-restart", "--no-block", PAGE)).run()
    return Replacement(before.get("state", _SILENT), state, without_s)


def _setpoints(socket: str, clock: Clock) -> Iterator[Message]:
    """Setpoints through a restart until patience is over; {} each time that nobody answers, or no longer."""
    never, end_s = threading.Event(), clock.monotonic() + PATIENCE_S
    while clock.monotonic() < end_s:
        try:
            with connect(socket, _TIMEOUT_S) as client:
                for setpoint in client.watch(_RATE_HZ):
                    yield setpoint
                    if clock.monotonic() >= end_s:
                        return
        except DaemonError:
            yield {}
            clock.wait(never, _LOOK_EVERY_S)
