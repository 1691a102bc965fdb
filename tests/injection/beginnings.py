"""How the faults of the matrix begin: each function returns what does it to a running machine."""

from __future__ import annotations

import math
from collections.abc import Callable

from tests.injection import faults
from tests.injection.case import Begin
from tests.injection.machine import Machine

# Where the scales stand when a fault begins: different for each, so that exchanged ones differ, and with more digits
# than a display that has been set to fewer.
REST_MM = (2.0034, 4.0047, 7.0061)
# How long a gauge that was without power is watched then, s: its line is opened again within this time.
REOPENED_S = 3.0


def on(line: str, make: Callable[[], faults.Fault]) -> Begin:
    """A fault of one line; made anew for every trial, since it keeps a state."""
    return lambda machine: machine.injector.fault(line, make())


def once(line: str, channel: str, mm: float) -> Begin:
    return on(line, lambda: faults.Off((channel,), mm, count=1))


def always(line: str, channel: str, mm: float) -> Begin:
    return on(line, lambda: faults.Off((channel,), mm))


def drifting(line: str, channel: str, mm_per_s: float) -> Begin:
    return on(line, lambda: faults.Off((channel,), drift_per_s=mm_per_s))


def shows(line: str, channel: str, number: float) -> Begin:
    return on(line, lambda: faults.Shows((channel,), number))


def away(*lines: str, s: float = 1.0) -> Begin:
    """Unplugged for so long, and plugged in again as they were."""

    def begin(machine: Machine) -> None:
        machine.injector.unplug(*lines)
        machine.rest_for(s)
        machine.injector.plug(*lines)

    return begin


def back_with(line: str, channel: str, mm: float, s: float = 2.0) -> Begin:
    """Without power for so long; then the gauge shows another number than before."""

    def begin(machine: Machine) -> None:
        machine.injector.unplug(line)
        machine.rest_for(s)
        machine.injector.fault(line, faults.Off((channel,), mm))
        machine.injector.plug(line)

    return begin


def while_driving(begin: Begin) -> Begin:
    def both(machine: Machine) -> None:
        begin(machine)
        machine.drive_away()

    return both


def before_driving(begin: Begin) -> Begin:
    """At rest, for longer than a poll takes; then the machine drives."""

    def both(machine: Machine) -> None:
        begin(machine)
        machine.rest_for(0.3)
        machine.drive_away()

    return both


def mute(*lines: str) -> Begin:
    """No reply at all."""

    def begin(machine: Machine) -> None:
        for line in lines:
            machine.injector.fault(line, faults.Lost(probability=1.0))

    return begin


def unplugged_driving(line: str) -> Begin:
    """Unplugged, and plugged in again after the machine has driven."""

    def begin(machine: Machine) -> None:
        machine.injector.unplug(line)
        machine.drive_away()
        machine.injector.plug(line)

    return begin


def exchanged(one: str, other: str) -> Begin:
    return lambda machine: machine.injector.exchange(one, other)


def replugged_exchanged(one: str, other: str) -> Begin:
    def begin(machine: Machine) -> None:
        machine.injector.unplug(one, other)
        machine.injector.exchange(one, other)
        machine.rest_for(0.5)
        machine.injector.plug(one, other)

    return begin


def flaps(*lines: str) -> Begin:
    def begin(machine: Machine) -> None:
        for _ in range(6):
            machine.injector.replug(*lines)
            machine.rest_for(0.1)

    return begin


def killed(process: str) -> Begin:
    return lambda machine: machine.kill(process)


def stalled(process: str = "", s: float = math.inf) -> Begin:
    """One process, or the whole daemon, is stopped for so long."""
    return lambda machine: machine.stall(process, s)


def at_zero(begin: Begin) -> Begin:
    """At machine zero, where a display shows 0 whatever its parameters; then the machine drives."""

    def both(machine: Machine) -> None:
        machine.drive((0.0, 0.0, 0.0))
        begin(machine)
        machine.drive_away()

    return both


def without_power(line: str, make: Callable[[], faults.Fault], s: float = 1.0) -> Begin:
    """Without power for so long, and back with this fault, for long enough to be read again."""

    def begin(machine: Machine) -> None:
        machine.injector.unplug(line)
        machine.rest_for(s)
        machine.injector.fault(line, make())
        machine.injector.plug(line)
        machine.rest_for(REOPENED_S)

    return begin


def ports_exchanged(one: str, other: str) -> Begin:
    return lambda machine: machine.reload((one, other))
