"""Of the error of a setpoint only the part is left out that hidden channels, or unseen motion, explain."""

from __future__ import annotations

import pytest

from compd.live.loop import Setpoint
from tests.support.paths import CONFIG
from tests.worlds.faults.gauges import creep, jump
from tests.worlds.faults.wiring import scales, wired
from tests.worlds.machines import measured_errors
from tests.worlds.unknowable import Judge, Unknowable
from tests.worlds.world import Told, built


def test_a_hidden_comparator_hides_its_own_share_of_the_error_and_no_scale() -> None:
    path = CONFIG / "tripod-cmm.yaml"
    left: dict[str, Unknowable] = {}
    with built(path, 7, strengths=measured_errors) as world:
        judge = Judge(world, lambda channel: 0.03)
        scale = f"{scales(world)[0]}.position"
        joint = next(channel.name for channel in wired(world.configuration) if channel.kind == "joint")

        def hear(setpoint: Setpoint, told: Told) -> None:
            for hidden in ({scale}, {joint}, {scale, joint}, set()):
                left[", ".join(sorted(hidden))] = judge.judge(setpoint, told, hidden, 0.0)

        world.hearers.append(hear)
        jump(world, scale, 0.008, 60.0)
        creep(world, joint, -0.01, 0.5, 60.0)
        world.run(0.6)
        told = world.told[-1]
    assert told.valid
    by_all_um, by_joint_um, by_scale_um = left[""].left_um, left[joint].left_um, left[scale].left_um
    assert by_all_um == pytest.approx(told.error_um)
    assert by_all_um > 8.0
    assert by_joint_um > 6.0  # that of the scale
    assert by_scale_um > 2.0  # that of the joint
    assert left[", ".join(sorted((scale, joint)))].left_um < 1.0
    assert not any(part.departed for part in left.values())
