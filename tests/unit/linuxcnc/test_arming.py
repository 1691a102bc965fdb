"""Corrections are switched on by a person, off by anything that is wrong, and never on by themselves."""

from __future__ import annotations

from typing import Any

import pytest

from tests.unit.linuxcnc import conftest  # noqa: F401  puts the bridge's folder on the path

import compd_arming as arming  # isort: skip
import compd_setpoints as setpoints  # isort: skip

PERIOD_S = 0.005
OFFSETS_MM = (0.01, 0.02, 0.03, -0.01, -0.02, -0.03)


class Bench:
    """An arming, its inputs, and the offsets that the bridge would have written."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.arming = arming.Arming(self.now_s)
        self.seq = 0
        self.offsets_mm: tuple[float, ...] = (0.0,) * 6
        self.pins = {"arm": False, "clear": False, "suspend": False, "machine_on": True, "homed": True}
        self.connected = True
        self.refusal = 0
        self.setpoint: setpoints.Setpoint | None = None
        self.daemon_lives = True
        self.correction_mm = OFFSETS_MM

    def step(self, pause_s: float = PERIOD_S, **pins: bool) -> arming.Outputs:
        self.now_s += pause_s
        self.pins |= pins
        if self.daemon_lives:
            self.seq += 1
            self.setpoint = setpoints.Setpoint(self.seq, self.correction_mm, self.now_s + 0.1)
        outputs = self.arming.step(
            arming.Inputs(
                now_s=self.now_s,
                connected=self.connected,
                setpoint=self.setpoint,
                refusal=self.refusal,
                **self.pins,
            )
        )
        if outputs.zero:
            self.offsets_mm = (0.0,) * 6
        elif outputs.applied is not None:
            self.offsets_mm = outputs.applied.correction_mm
        return outputs

    def steps(self, count: int, **pins: bool) -> arming.Outputs:
        for _ in range(count):
            outputs = self.step(**pins)
        return outputs

    def armed(self) -> Bench:
        self.step()
        assert self.step(arm=True).armed
        return self


FAULTS: dict[str, tuple[dict[str, Any], dict[str, bool], int]] = {
    "machine off": ({}, {"machine_on": False}, arming.MACHINE_OFF),
    "homing again": ({}, {"homed": False}, arming.NOT_HOMED),
    "daemon gone": ({"daemon_lives": False, "connected": False}, {}, setpoints.NOT_CONNECTED),
    "daemon silent": ({"daemon_lives": False}, {}, setpoints.EXPIRED),
    "not valid": ({"daemon_lives": False, "refusal": setpoints.NOT_VALID}, {}, setpoints.NOT_VALID),
    "not finite": ({"daemon_lives": False, "refusal": setpoints.NOT_FINITE}, {}, setpoints.NOT_FINITE),
}


def test_nothing_is_applied_before_a_rising_edge() -> None:
    bench = Bench()
    outputs = bench.steps(50)
    assert (outputs.armed, outputs.fault, outputs.reason) == (False, False, arming.NOT_ARMED)
    assert bench.offsets_mm == (0.0,) * 6
    assert bench.step(arm=True).armed
    assert bench.offsets_mm == OFFSETS_MM


def test_a_button_that_is_down_from_the_beginning_is_no_rising_edge() -> None:
    bench = Bench()
    assert not bench.steps(50, arm=True).armed
    bench.step(arm=False)
    assert bench.step(arm=True).armed


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_disarms_within_the_validity_and_nothing_arms_again_by_itself(name: str) -> None:
    fault, pins, reason = FAULTS[name]
    bench = Bench().armed()
    before = vars(bench).copy()
    for key, value in fault.items():
        setattr(bench, key, value)
    began_s = bench.now_s
    while (outputs := bench.step(**pins)).armed:
        assert bench.now_s - began_s < 0.12
    assert (outputs.fault, outputs.reason) == (True, reason)
    assert bench.offsets_mm == ((0.0,) * 6 if name == "homing again" else OFFSETS_MM)
    for key in fault:
        setattr(bench, key, before[key])
    bench.correction_mm = (0.1,) * 6
    outputs = bench.steps(200, machine_on=True, homed=True)
    assert (outputs.armed, outputs.fault, outputs.reason) == (False, True, reason)
    assert 0.1 not in bench.offsets_mm
    bench.step(arm=False)
    outputs = bench.step(arm=True)
    assert (outputs.armed, outputs.fault, outputs.reason) == (True, False, arming.ARMED)
    assert bench.offsets_mm == (0.1,) * 6


@pytest.mark.parametrize("name", FAULTS)
def test_it_cannot_be_armed_while_something_is_wrong_and_says_why(name: str) -> None:
    fault, pins, reason = FAULTS[name]
    bench = Bench()
    for key, value in fault.items():
        setattr(bench, key, value)
    bench.steps(30, **pins)
    outputs = bench.step(arm=True)
    assert (outputs.armed, outputs.fault, outputs.reason) == (False, True, reason)
    assert bench.offsets_mm == (0.0,) * 6


def test_one_damaged_message_does_nothing() -> None:
    bench = Bench().armed()
    bench.daemon_lives, bench.refusal = False, setpoints.NOT_FINITE
    assert bench.step().armed
    bench.daemon_lives, bench.refusal = True, 0
    assert bench.steps(50).armed


def test_a_bridge_that_was_stopped_disarms_although_the_newest_setpoint_is_good() -> None:
    bench = Bench().armed()
    outputs = bench.step(pause_s=0.3)
    assert (outputs.armed, outputs.reason) == (False, arming.PAUSED)
    assert not bench.steps(50).armed


def test_the_heart_beats_with_good_setpoints_alone() -> None:
    bench = Bench()
    beats = [bench.step().heartbeat for _ in range(6)]
    assert beats == [True, False, True, False, True, False]
    bench.daemon_lives = False
    assert len({bench.step().heartbeat for _ in range(50)}) == 1
    bench.daemon_lives = True
    assert len({bench.step(machine_on=False).heartbeat for _ in range(50)}) == 1


def test_suspend_holds_and_the_next_value_follows_afterwards() -> None:
    bench = Bench().armed()
    bench.correction_mm = (0.05,) * 6
    assert bench.steps(20, suspend=True).armed
    assert bench.offsets_mm == OFFSETS_MM
    assert bench.step(suspend=False).armed
    assert bench.offsets_mm == (0.05,) * 6


def test_disarming_holds_and_clear_takes_the_offsets_away_when_not_armed() -> None:
    bench = Bench().armed()
    bench.step(clear=True)
    assert bench.offsets_mm == OFFSETS_MM
    outputs = bench.step(arm=False, clear=False)
    assert (outputs.armed, outputs.fault, outputs.reason) == (False, False, arming.NOT_ARMED)
    assert bench.offsets_mm == OFFSETS_MM
    bench.step(clear=True)
    assert bench.offsets_mm == (0.0,) * 6


def test_every_reason_has_a_text() -> None:
    assert sorted(arming.REASONS) == list(range(14))
    assert setpoints.CLOCKS in arming.REASONS
    assert all(arming.REASONS.values())
