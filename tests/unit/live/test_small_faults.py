"""Small faults that add up: signal periods lost one by one, and scatter that is not the declared noise."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from compd.configuration import load
from compd.gauge import Quality, Reading, good
from compd.live.acquisition.cross_checks.cross_checks import LOOK_EVERY_S, Votes
from compd.live.acquisition.possible_motion import GaugeSample
from compd.live.loop.pipeline import build_pipeline
from compd.live.memory.latest import Latest
from compd.live.wired_trust import wired_channels, wired_memory, wired_trust
from tests.support.paths import CONFIG

MACHINES = ("tripod-cmm.yaml", "hexapod.yaml")
NOISE_UM = 0.1
PERIOD_MM = 0.020
# A scale's display answers after 8 ms, and is asked every 16 ms; comparators are asked every 36 ms.
TICK_S, SCALE_TICKS, OTHER_TICKS = 0.004, 4, 9
STEP_MM = 1e-5
Truth = Callable[[float], float]


class Machine:
    """All lengths of a shipped machine, read in turn in simulated time; each shows what the test says, with noise."""

    def __init__(self, name: str, declared_um: float | None = NOISE_UM) -> None:
        configuration = load(CONFIG / name)
        gauges = {g: o.model_copy(update={"noise_um": declared_um}) for g, o in configuration.gauges.items()}
        configuration = replace(configuration, gauges=gauges)
        pipeline = build_pipeline(configuration, configuration.gauge_objects())
        self.now_s = 1000.0
        self.ticks = 0
        self.memory = wired_memory(configuration, pipeline.wires)
        self.channels = self.memory.channels[: self.memory.lengths]
        self.scales = self.channels[: configuration.geometry.links]
        self.judges = wired_trust(configuration, pipeline.wires, self.memory)
        self.true_mm: dict[str, Truth] = {channel: lambda _: 0.0 for channel in self.channels}
        self.noise_um: dict[str, float] = dict.fromkeys(self.channels, NOISE_UM)
        self.lost: dict[str, float] = dict.fromkeys(self.channels, 0.0)  # share of its replies
        self.digit_mm = STEP_MM
        self.setpoint: dict[str, Any] | None = None
        self.published: dict[str, Reading] = {}
        self._random = np.random.default_rng(7)
        self.votes = Votes(
            configuration.votes,
            self.memory,
            wired_channels(configuration, pipeline.wires, pipeline.settings.model),
            {},
            Latest(["room.temperature"]),
            lambda: dict.fromkeys(self.channels, 0.0),
            lambda: None if self.setpoint is None else json.dumps(self.setpoint).encode(),
            configuration.geometry.scale_signal_period_mm or math.nan,
        )

    def run(self, duration_s: float) -> list[str]:
        """Names of the channels that wait for a person afterwards."""
        looks = round(LOOK_EVERY_S / TICK_S)
        for k in range(self.ticks, self.ticks + round(duration_s / TICK_S)):
            self.ticks = k + 1
            self.now_s += TICK_S
            for index, channel in enumerate(self.channels):
                if (k + index) % (SCALE_TICKS if channel in self.scales else OTHER_TICKS) == 0:
                    self._poll(channel)
            if k % looks == 0:
                self.votes.look(self.now_s)
        return [c for c in self.channels if self.memory.explanation(self.memory.index[c])]

    def _poll(self, channel: str) -> None:
        judge, first = self.judges[channel], None
        if self._random.random() < self.lost[channel]:
            judge.fail(Quality.CRC, self.now_s)
            return
        reading = self._reading(channel, self.now_s)
        if judge.surprises(GaugeSample(reading.value, reading.time_s, 0.001)):
            first, reading = reading, self._reading(channel, self.now_s + 2 * TICK_S)
        self.published[channel] = judge.judge(reading, 0.001, first)

    def _reading(self, channel: str, time_s: float) -> Reading:
        value = self.true_mm[channel](time_s) + self.noise_um[channel] * 1e-3 * self._random.standard_normal()
        return good(round(value / self.digit_mm) * self.digit_mm, time_s)

    def why(self, channel: str) -> str:
        return self.memory.explanation(self.memory.index[channel])

    @property
    def warnings(self) -> dict[str, str]:
        return self.memory.warnings.read() or {}

    def command(self, scale_mm: list[float]) -> None:
        """As in machine-tool mode."""
        self.setpoint = {"mode": "machine_tool", "valid": True, "scale_setpoint_mm": scale_mm}


@pytest.fixture(params=MACHINES)
def machine(request: pytest.FixtureRequest) -> Machine:
    """Each shipped machine at rest."""
    machine = Machine(request.param)
    assert machine.run(1.0) == []
    return machine


def steps(since_s: float, height_mm: float, every_s: float = 0.3, most: int = 1000) -> Truth:
    """Steps without a time on the way."""
    return lambda time_s: height_mm * min(most, max(0, math.floor((time_s - since_s) / every_s) + 1))


def jogged(since_s: float, height_mm: float, duration_s: float, every_s: float = 0.5, most: int = 1000) -> Truth:
    """A link that is moved in steps, each with a time on the way (smoothstep)."""

    def true_mm(time_s: float) -> float:
        if time_s < since_s:
            return 0.0
        number = min(math.floor((time_s - since_s) / every_s), most - 1)
        x = min(1.0, (time_s - since_s - number * every_s) / duration_s)
        return height_mm * (number + x * x * (3 - 2 * x))

    return true_mm


@pytest.mark.parametrize("height_mm", [PERIOD_MM, -PERIOD_MM, PERIOD_MM / 4])
def test_lost_signal_periods_are_found_when_they_add_up(machine: Machine, height_mm: float) -> None:
    scale = machine.scales[0]
    machine.true_mm[scale] = steps(machine.now_s + 0.1, height_mm, most=10)
    found = next(filter(None, (machine.run(0.1) for _ in range(40))), [])
    assert found == [scale]
    lost_mm = abs(machine.true_mm[scale](machine.now_s))
    assert lost_mm <= PERIOD_MM + abs(height_mm), "ten of them would be 300 um at the tip"
    assert "signal period" in machine.why(scale)
    assert "all other lengths stood" in machine.why(scale)


def test_one_lost_signal_period_may_be_a_link_that_was_moved(machine: Machine) -> None:
    scale = machine.scales[1]
    machine.true_mm[scale] = steps(machine.now_s + 0.1, PERIOD_MM, most=1)
    assert machine.run(3.0) == []
    assert "stepped at rest once" in machine.warnings[scale]
    assert "whole quarters of its signal period" in machine.warnings[scale]


def test_a_count_that_is_lost_and_found_again_is_no_error(machine: Machine) -> None:
    scale, since_s = machine.scales[0], machine.now_s + 0.1
    machine.true_mm[scale] = lambda time_s: PERIOD_MM * (math.floor(max(0.0, time_s - since_s) / 0.5) % 2)
    assert machine.run(4.3) == []
    assert machine.warnings == {}


@pytest.mark.parametrize("duration_s", [0.04, 0.1])
def test_a_link_that_is_jogged_by_a_signal_period_is_believed(machine: Machine, duration_s: float) -> None:
    scale = machine.scales[0]
    machine.true_mm[scale] = jogged(machine.now_s, PERIOD_MM, duration_s)
    assert machine.run(4.0) == []
    assert machine.warnings == {}


def test_a_link_that_is_seen_on_the_way_back_is_believed(machine: Machine) -> None:
    """Forward too fast for a reading on the way, and back slowly: somebody moves it."""
    scale, since_s = machine.scales[0], machine.now_s + 0.3

    def true_mm(time_s: float) -> float:
        part = max(0.0, time_s - since_s) % 0.8
        return 0.0 if part == 0.0 else PERIOD_MM * min(1.0, max(0.0, (0.5 - part) / 0.1))

    machine.true_mm[scale] = true_mm
    assert machine.run(4.0) == []


def test_a_machine_that_moves_in_small_steps_is_believed(machine: Machine) -> None:
    for k, scale in enumerate(machine.scales[:2]):
        machine.true_mm[scale] = steps(machine.now_s + 0.1, PERIOD_MM * (1 + k / 4))
    assert machine.run(4.0) == []
    assert machine.warnings == {}


def test_a_link_whose_joint_moves_too_is_believed(machine: Machine) -> None:
    joint = machine.channels[len(machine.scales)]
    machine.true_mm[machine.scales[0]] = steps(machine.now_s + 0.1, PERIOD_MM)
    machine.true_mm[joint] = steps(machine.now_s + 0.1, 0.004)
    assert machine.run(4.0) == []


def test_in_machine_tool_mode_one_is_enough_where_the_setpoint_stands(machine: Machine) -> None:
    scale = machine.scales[0]
    machine.command([0.0] * len(machine.scales))
    machine.run(3.0)
    machine.true_mm[scale] = steps(machine.now_s + 0.1, PERIOD_MM, most=1)
    assert machine.run(1.0) == [scale]
    assert "its setpoint stood" in machine.why(scale)


def test_in_machine_tool_mode_a_link_steps_as_it_is_told(machine: Machine) -> None:
    machine.command([0.0] * len(machine.scales))
    machine.run(3.0)
    for number in range(1, 6):
        machine.command([number * PERIOD_MM] + [0.0] * (len(machine.scales) - 1))
        machine.run(0.4)  # the controller follows so late
        machine.true_mm[machine.scales[0]] = lambda _, height_mm=number * PERIOD_MM: height_mm
        assert machine.run(0.6) == []
    assert machine.warnings == {}


def test_what_a_person_accepts_counts_anew(machine: Machine) -> None:
    scale = machine.scales[0]
    machine.true_mm[scale] = steps(machine.now_s + 0.1, PERIOD_MM, most=2)
    assert machine.run(1.0) == [scale]
    machine.memory.accept(scale)
    assert machine.run(1.0) == []
    assert machine.warnings == {}


def hum(amplitude_mm: float, hertz: float = 50.0) -> Truth:
    return lambda time_s: amplitude_mm * math.sin(2 * math.pi * hertz * time_s)


@pytest.mark.parametrize("amplitude_um", [5.0, 20.0])
def test_hum_is_told_and_measured(machine: Machine, amplitude_um: float) -> None:
    scale = machine.scales[0]
    machine.true_mm[scale] = hum(amplitude_um * 1e-3)
    machine.run(7.0)
    assert list(machine.warnings) == [scale]
    assert "declared: 0.1 um" in machine.warnings[scale]
    motion = machine.published[scale].motion
    assert motion is not None
    assert motion.scatter_mm == pytest.approx(amplitude_um * 1e-3 / math.sqrt(2), rel=0.2)


@pytest.mark.parametrize("disturbance", ["noise", "hum"])
def test_noise_that_begins_counts_before_it_is_measured(machine: Machine, disturbance: str) -> None:
    """The machine has rested for long: windows of seconds say that nothing scatters."""
    scale, random = machine.scales[0], np.random.default_rng(4)
    machine.run(7.0)
    quiet = machine.published[scale].motion
    machine.true_mm[scale] = hum(0.005) if disturbance == "hum" else lambda _: 0.004 * random.standard_normal()
    machine.run(0.2)
    motion = machine.published[scale].motion
    assert quiet is not None
    assert quiet.scatter_mm < 0.0002
    assert motion is not None
    assert 0.002 < motion.scatter_mm < 0.008


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("lost", [0.0, 0.5])
def test_a_joint_that_begins_to_hum_says_so_with_each_reading(name: str, lost: float) -> None:
    """The scales stand, so it does; readings are rare where replies are lost, and each is as wrong as it says."""
    wrong = 0
    for late_s in np.arange(6) * 0.003:
        machine = Machine(name)
        joint, since_s = machine.channels[len(machine.scales)], machine.now_s + 1.0 + late_s
        machine.true_mm[joint] = lambda time_s, since_s=since_s: hum(0.005)(max(0.0, time_s - since_s))
        machine.run(1.0)
        machine.lost[joint] = lost
        for _ in range(75):
            machine.run(TICK_S)
            reading = machine.published[joint]
            if reading.ok and abs(reading.value) > 2e-3:
                assert reading.motion is not None
                assert abs(reading.value) < 2 * math.sqrt(2) * reading.motion.scatter_mm
                wrong += 1
    assert wrong > 0


def test_joints_that_move_with_their_scales_do_not_scatter(machine: Machine) -> None:
    links, since_s, acceleration = len(machine.scales), machine.now_s + 0.1, 50.0
    for k, channel in enumerate(machine.channels):
        share = 0.5 * acceleration * (1.0 if k < links else 0.01)  # 10 um from one poll of a joint to the next
        machine.true_mm[channel] = lambda time_s, share=share: share * max(0.0, time_s - since_s) ** 2
    for _ in range(6):
        machine.run(0.1)
        scatter_mm = [reading.motion.scatter_mm for reading in machine.published.values() if reading.motion]
        assert not any(mm > 2e-4 for mm in scatter_mm)


@pytest.mark.parametrize(("noise_um", "is_told"), [(0.3, True), (0.14, False), (0.08, False), (0.03, True)])
def test_the_declared_noise_is_compared_with_the_scatter(machine: Machine, noise_um: float, is_told: bool) -> None:
    machine.noise_um = dict.fromkeys(machine.channels, noise_um)
    machine.run(6.0)
    assert (list(machine.warnings) == list(machine.channels)) is is_told
    if not is_told:
        assert machine.warnings == {}
    scatter_mm = machine.memory.scatter_mm[: len(machine.channels)]
    assert scatter_mm == pytest.approx(noise_um * 1e-3, rel=0.25)


def test_a_noise_that_is_not_declared_is_compared_with_nothing() -> None:
    machine = Machine(MACHINES[0], declared_um=None)
    machine.run(10.0)
    assert machine.warnings == {}


@pytest.mark.parametrize("name", MACHINES)
def test_a_display_with_coarse_digits_scatters_less_than_it_measures(name: str) -> None:
    machine = Machine(name)
    machine.digit_mm = 5e-4
    machine.noise_um = dict.fromkeys(machine.channels, 0.01)
    for channel in machine.channels:  # each changes once, so that the size of its digits is known
        machine.true_mm[channel] = lambda time_s: 5e-4 if time_s > 1003.0 else 0.0
    machine.run(8.0)
    assert machine.warnings == {}


@pytest.mark.parametrize("speed_mm_per_s", [0.001, 0.05, 20.0])
def test_motion_and_drift_are_no_scatter(machine: Machine, speed_mm_per_s: float) -> None:
    since_s = machine.now_s
    for k, scale in enumerate(machine.scales):
        machine.true_mm[scale] = lambda time_s, k=k: (1 + k / 10) * speed_mm_per_s * (time_s - since_s)
    machine.run(10.0)
    assert machine.warnings == {}


@pytest.mark.parametrize("travel_s", [0.5, 1.3])
def test_a_machine_that_goes_from_point_to_point_does_not_scatter(machine: Machine, travel_s: float) -> None:
    since_s = machine.now_s

    def to_and_fro(time_s: float, amplitude_mm: float) -> float:
        """As fast as 300 mm/s2 allow, with a rest at each end."""
        phase = (time_s - since_s) / travel_s % 4
        x = min(1.0, phase) if phase < 2 else 1 - min(1.0, phase - 2)
        return amplitude_mm * x * x * (3 - 2 * x)

    largest_mm = 250.0 * travel_s**2 / 6
    for k, scale in enumerate(machine.scales):
        machine.true_mm[scale] = lambda time_s, a=largest_mm * (1 - k / 10): to_and_fro(time_s, min(a, 20.0))
    assert machine.run(8.0) == []
    assert machine.warnings == {}
