"""What the gauges say of each other: each vote names the gauge that the others contradict, and only that one."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import numpy as np

from compd.gauge import good
from compd.live.acquisition.cross_checks.cross_checks import LOOK_EVERY_S, Votes
from compd.live.acquisition.cross_checks.machine_view import WiredLength
from compd.live.acquisition.possible_motion import MotionLimits
from compd.live.acquisition.reading_trust import ReadingTrust, TrustSettings
from compd.live.memory.latest import Latest
from compd.live.memory.trust_memory import TrustMemory
from compd.operation_settings import FrameVote, VoteSettings
from compd.stated_noise import tolerance_mm

NOISE_UM, STEP_MM, POLL_S = 0.05, 0.00001, 0.01
SCALES = ("scale_1.position", "scale_2.position", "scale_3.position")
JOINTS = ("joints.1", "joints.2")
FRAME = ("cabinet.t1", "cabinet.t2")
CHANNELS = (*SCALES, *JOINTS, *FRAME)
NAN = math.nan
WIRED = (
    *(WiredLength("scale", f"scale {k}", 1, k, "", NAN, NOISE_UM * 1e-3) for k in (1, 2, 3)),
    WiredLength("joint", "joint 1", 1, 1, "Ra", NAN, NOISE_UM * 1e-3),
    WiredLength("joint", "joint 2", 1, 1, "Rb", NAN, NOISE_UM * 1e-3),
    WiredLength("frame", "frame t1", 1, 0, "", 500.0, NOISE_UM * 1e-3),
    WiredLength("frame", "frame t2", -1, 0, "", 500.0, NOISE_UM * 1e-3),
)


class Machine:
    """Seven gauges that are polled 100 times a second and looked at ten times, in simulated time."""

    def __init__(self, settings: VoteSettings | None = None, noise_um: float = NOISE_UM) -> None:
        self.now_s = 1000.0
        self.true_mm: dict[str, Callable[[float], float]] = {channel: lambda _: 0.0 for channel in CHANNELS}
        self.frozen: dict[str, float] = {}
        self.unread: set[str] = set()
        self.temperature_degC = 20.0
        self.setpoint: dict[str, object] | None = None
        self.memory = TrustMemory(CHANNELS, [tolerance_mm(NOISE_UM)] * len(CHANNELS))
        trust = TrustSettings(MotionLimits(), returns_by_itself=False, stale_after_s=0.5, restart_s=0.5)
        self.judges = {channel: ReadingTrust(self.memory, channel, trust) for channel in CHANNELS}
        self.latest = Latest(["cabinet.frame"])
        self._noise_mm = noise_um * 1e-3
        self._random = np.random.default_rng(3)
        self._settings = settings or VoteSettings()
        self.start_votes()

    def start_votes(self) -> None:
        """As a new process would."""
        self.votes = Votes(
            self._settings,
            self.memory,
            WIRED,
            {"temperature_frame_degC": ("cabinet.frame", 0.5)},
            self.latest,
            lambda: dict.fromkeys(CHANNELS, 0.0),
            lambda: None if self.setpoint is None else json.dumps(self.setpoint).encode(),
        )

    def run(self, duration_s: float) -> list[str]:
        """Names of the channels that are not believed afterwards."""
        polls = round(LOOK_EVERY_S / POLL_S)
        for k in range(round(duration_s / POLL_S)):
            self.now_s += POLL_S
            self.latest.put(0, good(self.temperature_degC, self.now_s))
            for channel in CHANNELS:
                if channel not in self.unread:
                    self.poll(channel)
            if k % polls == 0:
                self.votes.look(self.now_s)
        return [c for c in CHANNELS if self.memory.explanation(self.memory.index[c])]

    def poll(self, channel: str) -> None:
        value = self.true_mm[channel](self.now_s) + self._noise_mm * self._random.standard_normal()
        value = self.frozen.get(channel, round(value / STEP_MM) * STEP_MM)
        reading = good(value, self.now_s)
        self.judges[channel].judge(reading, 0.001, reading)

    def why(self, channel: str) -> str:
        return self.memory.explanation(self.memory.index[channel])


def driving(speed: float, since_s: float) -> Callable[[float], float]:
    return lambda time_s: speed * (time_s - since_s)


def test_gauges_at_rest_and_on_the_move_are_not_contradicted():
    machine = Machine()
    assert machine.run(5.0) == []
    for k, channel in enumerate(SCALES):
        machine.true_mm[channel] = driving(1.0 + k, machine.now_s)
    assert machine.run(5.0) == []


def test_a_gauge_that_repeats_its_digits_while_others_scatter_is_stuck():
    machine = Machine()
    machine.run(5.0)
    machine.frozen["joints.1"] = 0.00003
    assert machine.run(2.0) == ["joints.1"]
    assert "the same digits" in machine.why("joints.1")
    assert "others scatter" in machine.why("joints.1")


def test_a_whole_unit_that_repeats_its_digits_is_stuck():
    machine = Machine()
    machine.run(5.0)
    machine.frozen |= dict.fromkeys(JOINTS, 0.00003)
    assert machine.run(2.0) == list(JOINTS)


def test_a_simulation_that_pauses_accuses_nobody():
    machine = Machine()
    machine.run(5.0)
    machine.frozen |= dict.fromkeys(CHANNELS, 0.0)
    assert machine.run(5.0) == []


def test_a_gauge_whose_noise_is_below_its_resolution_may_repeat_its_digits():
    machine = Machine(noise_um=0.001)
    machine.run(5.0)
    machine.frozen["joints.1"] = 0.0
    assert machine.run(5.0) == []


def test_an_accepted_gauge_is_believed_until_the_next_vote():
    machine = Machine()
    machine.run(5.0)
    machine.frozen["joints.1"] = 0.00003
    machine.run(2.0)
    del machine.frozen["joints.1"]
    machine.memory.accept("joints.1")
    assert machine.run(5.0) == []


def test_a_scale_that_stands_while_all_others_move_is_not_believed():
    machine = Machine()
    machine.run(1.0)
    for channel in SCALES[1:]:
        machine.true_mm[channel] = driving(5.0, machine.now_s)
    assert machine.run(0.3) == []
    assert machine.run(0.4) == ["scale_1.position"]
    assert "stands while all others have moved by 2." in machine.why("scale_1.position")


def test_a_link_that_arrives_before_the_others_is_not_stuck():
    machine = Machine()
    machine.run(1.0)
    departs_s = machine.now_s
    for channel, way_mm in zip(SCALES, (3.0, 20.0, -15.0), strict=True):
        machine.true_mm[channel] = lambda time_s, way_mm=way_mm: math.copysign(
            min(30.0 * (time_s - departs_s), abs(way_mm)), way_mm
        )
    assert machine.run(5.0) == []


def test_scales_that_were_not_read_while_they_move_are_not_at_rest():
    machine = Machine()
    machine.run(1.0)
    departs_s = machine.now_s
    for channel, way_mm in zip(SCALES, (5.0, 60.0, -60.0), strict=True):
        machine.true_mm[channel] = lambda time_s, way_mm=way_mm: math.copysign(
            min(30.0 * (time_s - departs_s), abs(way_mm)), way_mm
        )
    assert machine.run(0.5) == []  # the first has arrived
    machine.unread = set(SCALES)
    assert machine.run(0.25) == []
    machine.unread = set()
    assert machine.run(2.0) == []


def test_a_scale_that_sticks_just_after_its_departure_has_no_value_and_is_not_believed_after_some_readings():
    machine = Machine()
    machine.run(2.0)
    departs_s = machine.now_s
    for channel in SCALES[1:]:
        machine.true_mm[channel] = driving(20.0, departs_s)
    machine.frozen["scale_1.position"] = 0.05
    assert machine.run(0.5) == ["scale_1.position"]
    assert "stands while all others have moved by" in machine.why("scale_1.position")


def test_a_suspicion_does_not_outlive_the_acquisition_that_had_it():
    machine = Machine()
    machine.memory.suspected[0] = True
    machine.start_votes()
    assert not machine.memory.suspected[0]


def test_a_link_with_hardly_any_way_to_go_has_a_value_again_when_its_digits_change():
    machine = Machine()
    machine.run(2.0)
    departs_s = machine.now_s
    for channel in SCALES[1:]:
        machine.true_mm[channel] = driving(20.0, departs_s)
    machine.true_mm["scale_1.position"] = lambda _: 0.05
    suspected = []
    for _ in range(20):
        assert machine.run(0.05) == []
        suspected.append(bool(machine.memory.suspected[machine.memory.index["scale_1.position"]]))
    assert any(suspected)
    assert not any(suspected[-10:])


def test_a_scale_that_is_not_read_for_a_while_does_not_stand():
    machine = Machine()
    machine.run(1.0)
    for channel in SCALES:
        machine.true_mm[channel] = driving(50.0, machine.now_s)
    for _ in range(10):
        machine.unread = {"scale_1.position"}
        assert machine.run(0.25) == []
        machine.unread = set()
        assert machine.run(0.15) == []


def test_one_link_that_moves_alone_accuses_nobody():
    machine = Machine()
    machine.true_mm["scale_2.position"] = driving(5.0, machine.now_s)
    assert machine.run(5.0) == []


def test_machine_tool_mode_a_scale_that_does_not_follow_its_setpoint():
    machine = Machine(VoteSettings(following_mm=0.1))
    machine.setpoint = {"mode": "machine_tool", "valid": True, "scale_setpoint_mm": [0.0, 0.5, 0.0]}
    assert machine.run(0.8) == []
    assert machine.run(0.5) == ["scale_2.position"]
    assert "is -0.500 mm from its setpoint" in machine.why("scale_2.position")


def test_two_ball_shanks_of_one_joint_that_move_apart():
    machine = Machine(VoteSettings(joint_pair_um=10.0))
    machine.true_mm["joints.2"] = driving(0.01, machine.now_s)
    assert machine.run(1.0) == []
    assert machine.run(1.0) == ["joints.2"]
    assert "from joint 1 at the same joint, allowed 10 um" in machine.why("joints.2")


def test_a_tip_that_would_move_faster_than_it_can_names_the_scale_that_moved_most():
    machine = Machine(VoteSettings(tip_mm_per_s=50.0))
    machine.setpoint = {"mode": "cmm", "valid": True, "time_s": machine.now_s, "tip_M_mm": [0.0, 0.0, 0.0]}
    assert machine.run(0.1) == []
    machine.true_mm["scale_3.position"] = lambda _: 20.0
    machine.setpoint |= {"time_s": machine.now_s + 0.1, "tip_M_mm": [20.0, 0.0, 0.0]}
    assert machine.run(0.3) == ["scale_3.position"]
    assert "the tip would move at " in machine.why("scale_3.position")


def test_a_frame_that_grows_as_its_temperature_says_is_believed_and_a_comparator_that_drifts_is_not():
    frame = FrameVote(temperature="temperature_frame_degC", expansion_ppm_per_K=11.0, tolerance_um=8.0)
    machine = Machine(VoteSettings(frame=frame))
    machine.run(0.5)
    machine.temperature_degC = 24.0  # 22 um in 500 mm
    machine.true_mm["cabinet.t1"] = lambda _: 0.022
    machine.true_mm["cabinet.t2"] = lambda _: -0.022  # its display counts down
    assert machine.run(0.5) == []
    machine.true_mm["cabinet.t1"] = driving(0.01, machine.now_s - 2.2)
    assert machine.run(1.5) == ["cabinet.t1"]
    assert "temperature_frame_degC explains +22.0 um" in machine.why("cabinet.t1")


def test_a_tip_that_catches_up_after_a_scale_was_not_read_is_not_too_fast():
    machine = Machine(VoteSettings(tip_mm_per_s=60.0))

    def tip_is_at(x_mm: float) -> None:
        machine.setpoint = {"mode": "cmm", "valid": True, "time_s": machine.now_s, "tip_M_mm": [x_mm, 0.0, 0.0]}

    tip_is_at(0.0)
    assert machine.run(0.1) == []
    machine.unread = {"scale_3.position"}
    for _ in range(3):
        tip_is_at(0.0)
        assert machine.run(0.1) == []
    machine.unread = set()
    tip_is_at(15.0)
    assert machine.run(0.1) == []
    tip_is_at(30.0)
    assert machine.run(0.1) != []
