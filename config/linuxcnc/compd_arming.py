"""Whether corrections of compd reach the motors: armed by a person, disarmed by anything that is wrong.

The standard library alone. There is no clock and no HAL in it: a step takes inputs and returns outputs.
"""

from __future__ import annotations

from typing import NamedTuple

from compd_setpoints import (
    CLOCKS,
    EXPIRED,
    NOT_CONNECTED,
    NOT_FINITE,
    NOT_VALID,
    OLD_SEQ,
    TOO_LARGE,
    UNREADABLE,
    WRONG_LINKS,
    Setpoint,
)

ARMED, NOT_ARMED = 0, 1
MACHINE_OFF, NOT_HOMED, PAUSED = 11, 12, 13

REASONS = {
    ARMED: "armed: corrections are applied",
    NOT_ARMED: "not armed: give compd.arm a rising edge",
    NOT_CONNECTED: "no connection to compd",
    NOT_VALID: "compd says that its setpoints are not valid: `compd status` says why",
    EXPIRED: "the last setpoint has expired",
    OLD_SEQ: "setpoints came twice or out of order",
    NOT_FINITE: "a number is not finite",
    WRONG_LINKS: "setpoints are for another number of links",
    TOO_LARGE: "a correction is larger than the bridge's --limit",
    UNREADABLE: "a message cannot be read",
    CLOCKS: "setpoints are from the future: compd runs on another clock; connect by TCP",
    MACHINE_OFF: "the machine is off",
    NOT_HOMED: "not every joint is homed",
    PAUSED: "the bridge was stopped for longer than it may be",
}

# As long as the watchdog waits: a bridge that was stopped so long must not go on as if nothing had been.
PAUSE_S = 0.2


class Inputs(NamedTuple):
    """What the bridge sees in one step.

    arm, clear, suspend, machine_on, homed : the pins. connected : whether compd has greeted.
    setpoint : the newest that may be used; None before the first of a connection.
    refusal : reason why a newer one is not used; 0 where there is none.
    """

    now_s: float
    arm: bool
    clear: bool
    suspend: bool
    machine_on: bool
    homed: bool
    connected: bool
    setpoint: Setpoint | None
    refusal: int


class Outputs(NamedTuple):
    """What the bridge shows. fault : corrections were switched off by `reason`, or could not be switched on.
    applied : the setpoint whose corrections are to be written; None to hold what is written. zero : write 0 instead.
    age_s : since the last usable setpoint arrived, s."""

    armed: bool
    fault: bool
    reason: int
    heartbeat: bool
    applied: Setpoint | None
    zero: bool
    age_s: float


class Arming:
    """Corrections are on from a rising edge of `arm` until anything is wrong, and never by themselves again.

    A setpoint that is refused is not used; the last good one stays until it expires. So a single damaged message
    does nothing, and a fault shows within `sockets.valid_for_s`.
    """

    def __init__(self, now_s: float) -> None:
        self._armed = False
        self._fault = NOT_ARMED
        # a button that is down when the bridge starts is no rising edge
        self._arm_before = True
        self._heartbeat = False
        self._seen: Setpoint | None = None
        self._seen_s = self._step_s = now_s

    def step(self, inputs: Inputs) -> Outputs:
        rising = inputs.arm and not self._arm_before
        self._arm_before = inputs.arm
        paused = inputs.now_s - self._step_s > PAUSE_S
        self._step_s = inputs.now_s
        obstacle = PAUSED if paused else _obstacle(inputs)
        if self._armed and obstacle:
            self._armed, self._fault = False, obstacle
        elif self._armed and not inputs.arm:
            self._armed, self._fault = False, NOT_ARMED
        elif rising and not self._armed:
            self._armed, self._fault = not obstacle, obstacle
        new = inputs.setpoint is not None and inputs.setpoint is not self._seen
        if new and not obstacle:
            # the beat is that of good setpoints: the watchdog bites when they stop, whatever this process does
            self._heartbeat = not self._heartbeat
        if new:
            self._seen, self._seen_s = inputs.setpoint, inputs.now_s
        apply = self._armed and not inputs.suspend
        return Outputs(
            armed=self._armed,
            fault=self._fault not in (ARMED, NOT_ARMED),
            reason=ARMED if self._armed else self._fault,
            heartbeat=self._heartbeat,
            applied=inputs.setpoint if apply else None,
            zero=not inputs.homed or (inputs.clear and not self._armed),
            age_s=inputs.now_s - self._seen_s,
        )


def _obstacle(inputs: Inputs) -> int:
    """The reason why corrections cannot be applied; 0 where they can."""
    if not inputs.machine_on:
        return MACHINE_OFF
    if not inputs.homed:
        return NOT_HOMED
    if not inputs.connected:
        return NOT_CONNECTED
    if inputs.setpoint is None or inputs.now_s >= inputs.setpoint.expires_s:
        return inputs.refusal or EXPIRED
    return ARMED
