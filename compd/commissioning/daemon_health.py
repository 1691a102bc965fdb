"""The state of the running daemon in words, and as the exit code that monitoring plug-ins have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from compd.client import Message, connect
from compd.errors import DaemonError
from compd.setpoint_states import State, state_named

# Rate (Hz) of setpoints for a look; the daemon makes hundreds a second.
_RATE_HZ = 10.0
_MAX_GAUGES = 5


class Health(IntEnum):
    """Exit codes of monitoring plug-ins.

    https://www.monitoring-plugins.org/doc/guidelines.html, "Plugin Return Codes".
    """

    OK = 0
    WARNING = 1
    CRITICAL = 2
    UNKNOWN = 3


@dataclass(frozen=True)
class DaemonStatus:
    """The daemon's answers, or its silence.

    health : OK; WARNING, valid but not ok; CRITICAL, invalid or stopped; UNKNOWN, no answer.
    state, reason : of the last setpoint; "" without one.
    gauges : those that are not good, in words; where all are, the one whose reading is oldest; then those with a
        warning.
    setpoint, status : the messages.
    """

    health: Health
    machine: str
    state: str
    reason: str
    gauges: tuple[str, ...] = ()
    setpoint: Mapping[str, Any] = field(default_factory=dict)
    status: Mapping[str, Any] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """One line for a monitoring system: health, state and its meaning, reason."""
        state = state_named(self.state)
        meaning = f" ({state.text})" if state is not None and not self.reason else ""
        what = f"{self.machine} {self.state}{meaning}" if self.state else self.machine
        return f"{self.health.name}: {what}" + (f": {self.reason}" if self.reason else "")

    def to_json(self) -> dict[str, Any]:
        """The same as plain data."""
        return {
            "health": self.health.name.lower(),
            "exit_code": int(self.health),
            "machine": self.machine,
            "state": self.state,
            "valid": self.health in (Health.OK, Health.WARNING),
            "reason": self.reason,
            "gauges": list(self.gauges),
            "setpoint": dict(self.setpoint),
            "status": dict(self.status),
        }


def daemon_status(address: str, timeout_s: float = 5.0) -> DaemonStatus:
    """Ask the daemon at this address for its status and a setpoint, without changing its operation."""
    try:
        with connect(address, timeout_s) as client:
            machine = str(client.version["machine"])
            status = client.status()
            try:
                setpoint: Message = next(client.watch(_RATE_HZ))
            except DaemonError as error:
                return DaemonStatus(
                    Health.CRITICAL, machine, "", f"no setpoint: {error.problems[0].what}", status=status
                )
    except DaemonError as error:
        return DaemonStatus(Health.UNKNOWN, address, "", error.problems[0].what)
    state = state_named(setpoint["state"])
    health = Health.CRITICAL if not setpoint["valid"] else Health.OK if state is State.OK else Health.WARNING
    gauges = (*worst_gauges(status["gauges"]), *warnings_of(status["gauges"]))
    return DaemonStatus(health, machine, setpoint["state"], setpoint.get("reason", ""), gauges, setpoint, status)


def worst_gauges(gauges: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Gauges that are not good, several channels of one together: "joints, 9 channels: line_lost (...)"."""
    bad: dict[tuple[str, str, str], list[str]] = {}
    for gauge in gauges:
        if gauge["quality"] != "ok":
            name, _, channel = str(gauge["channel"]).partition(".")
            bad.setdefault((name, str(gauge["quality"]), str(gauge.get("detail", ""))), []).append(channel)
    if not bad:
        oldest = max(gauges, key=lambda gauge: float(gauge.get("age_s", 0.0)), default=None)
        return (
            () if oldest is None else (f"oldest reading: {oldest['channel']}, {oldest.get('age_s', 0.0) * 1e3:.0f} ms",)
        )
    words = []
    for (name, quality, detail), channels in bad.items():
        who = f"{name}.{channels[0]}" if len(channels) == 1 else f"{name}, {len(channels)} channels"
        words.append(f"{who}: {quality}" + (f" ({detail})" if detail else ""))
    more = [f"and {len(words) - _MAX_GAUGES} more"] if len(words) > _MAX_GAUGES else []
    return (*words[:_MAX_GAUGES], *more)


def warnings_of(gauges: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Warnings about gauges that are believed nevertheless."""
    words = [f"{gauge['channel']}: warning: {gauge['warning']}" for gauge in gauges if gauge.get("warning")]
    more = [f"and {len(words) - _MAX_GAUGES} more warnings"] if len(words) > _MAX_GAUGES else []
    return (*words[:_MAX_GAUGES], *more)
