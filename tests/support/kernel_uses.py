"""Small jobs that together use every compiled kernel, the same ones each time."""

from __future__ import annotations

from typing import Any

import numpy as np

import compd
from compd.comparison import open_recording
from compd.configuration import load
from compd.gauge import ReadingMotion, good
from compd.live.memory import Readings
from compd.live.record import RecordedCycles, replay_cycles
from compd.model import MachineModel, sensitivities
from compd.model.effects import evaluate_basis
from compd.model.kinematics import (
    forward_kinematics,
    links_at,
    track_motion,
)
from compd.rotation import compose, rotation_matrix, rotation_vector
from compd.simulation import World
from tests.support.effect_rows import HEXAPOD, LIBRARY, TRIPOD, constants_of, observe_rows, random_inputs
from tests.support.formulas import written
from tests.support.live_machine import RAW_AT_ZERO_MM, machine
from tests.support.live_models import with_noise
from tests.support.model_machines import inverse_pose
from tests.support.paths import CONFIG, ROOT

FILES = ROOT / "tests" / "guard" / "files-0.2"


def use_all_kernels() -> None:
    """Rotations, poses, effects and formulas of rows, a comparison, cycles of both machines at rest and in motion,
    and the simulated machine."""
    random = np.random.default_rng(1)
    R = rotation_matrix(random.normal(size=(1000, 3)))
    rotation_vector(compose(R, R[::-1]))
    for model in (TRIPOD, HEXAPOD):
        _pose(model, random)
        rows = observe_rows(model, random_inputs(model))
        sensitivities(model, rows, ["scale"])
        for effect in LIBRARY.values():
            evaluate_basis(effect, rows, constants_of(effect), None)
    # whether w is a period is seen from the formula's values
    written({"x": "a * sin(w * x_mm)", "z": "a * w + b * lag(x_mm, w)"}, port="tool", parameters="a b w")
    compd.compare(open_recording(FILES / "campaign.csv", CONFIG / "tripod-cmm.yaml"))
    for name in ("tripod-cmm", "hexapod"):
        list(replay_cycles(load(FILES / f"{name}.yaml"), RecordedCycles(FILES / f"{name}-run")))
        _in_motion(with_noise(machine(f"{name}.yaml"), 0.1))
        configuration = load(CONFIG / f"{name}.yaml")
        World(configuration.geometry, configuration.wiring, seed=1).advance(1.0)


def _pose(model: MachineModel, random: np.random.Generator) -> None:
    """Poses by lengths and by actuators, their derivatives, and the directions of moving links."""
    zero = model.zero
    mechanism = model.mechanism(zero.base_joints_M_mm)
    tip_M_mm = zero.contact.tip_M_mm + random.uniform(-60, 60, (50, 3))
    pose = inverse_pose(model, mechanism, tip_M_mm, zero.contact.tip_P_mm, zero.rotation_M_P)
    forward_kinematics(mechanism, pose.link_length_mm, pose.origin_M_mm, pose.rotation_M_P)
    moved_mm = random.normal(size=(50, model.links))
    links_at(model.actuators, zero.base_joints_M_mm, moved_mm)
    track_motion(None, np.arange(50.0), moved_mm, random.normal(size=(50, 2)))


def _in_motion(live: Any) -> None:
    """Cycles in which every length moves by itself and is read at another time; what is read goes over a wire."""
    for cycle in range(3):
        live.now_s += 0.005
        live.tick += 1
        for number, (channel, slot) in enumerate(live.latest.index.items()):
            time_s = live.now_s - 0.001 * (1 + number)
            if channel in live.change_mm:
                value, motion = (
                    RAW_AT_ZERO_MM + 1e-3 * cycle * number,
                    ReadingMotion(5.0, 0.0, 0.1, 1.0, 5.0, 0.01, 1.0),
                )
            else:
                value, motion = 20.0 + 0.01 * cycle, None
            live.latest.put(slot, good(value, time_s)._replace(motion=motion))
        live.run_cycle()
    Readings.checked(live.latest.snapshot(live.now_s).readings.image)
