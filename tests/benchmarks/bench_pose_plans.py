"""The tip's standard error after 20 planned poses, beside 20 random ones and 20 on a grid, for the eight machines.

    python -m tests.benchmarks.bench_pose_plans

Prints the table of docs/how-to/calibrate-a-machine.md. An instrument of 5 um, and of 5 urad for whole poses; the
machines of `compd machine new`, machined to 0.05 mm. The random poses are drawn 20 times from those that the exchange
chooses from; the median is printed. The grid has as many levels as give 20 poses that are reached, of which 20 are
taken evenly.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from compd.calibration import Noise, PoseCandidates, PoseStudy, reachable
from compd.configuration import load
from compd.machine_builder import build_model
from compd.machine_kinds import KINDS, machine_text
from compd.model import MachineModel
from tests.benchmarks.limits import run_limited

POSES = 20
NOISE = Noise(5.0, 5.0)


def machine(directory: Path, kind: str) -> MachineModel:
    path = directory / f"{kind}.yaml"
    path.write_text(machine_text(kind, kind, KINDS[kind].usual), encoding="utf-8")
    configuration = load(path)
    return build_model(configuration.geometry, configuration.wiring)


def on_a_grid(study: PoseStudy) -> PoseCandidates:
    """Places and turns in equal steps between the limits of the workspace."""
    model, box = study.model, study.box
    fixed = np.flatnonzero(model.actuators.fixed == 1)
    at_zero = np.concatenate([model.zero.contact.tip_M_mm, np.zeros(3)])
    levels = 2
    while True:
        levels += 1
        axes = [np.linspace(box.low[i], box.high[i], levels) for i in fixed]
        lattice = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(fixed))
        poses = np.tile(at_zero, (len(lattice), 1))
        poses[:, fixed] = lattice
        reached = reachable(model, poses, study.stroke_mm)
        if (count := len(reached.turn_rad)) >= POSES:
            return reached.select(np.linspace(0, count - 1, POSES).round().astype(np.int64))


def random_um(study: PoseStudy) -> float:
    rng = np.random.default_rng(3)
    count = len(study.candidates.turn_rad)
    return float(
        np.median(
            [study.tip_std_um(study.candidates.select(rng.choice(count, POSES, replace=False))) for _ in range(20)]
        )
    )


def main() -> None:
    print("| machine | measured | by the tolerance | planned | random | grid | O1 planned | O1 grid |")
    print("|---|---|---|---|---|---|---|---|")
    with TemporaryDirectory() as directory:
        for measured in ("position", "pose"):
            for kind in KINDS:
                study = PoseStudy(machine(Path(directory), kind), measured, NOISE)
                plan, grid = study.plan(POSES), on_a_grid(study)
                O1 = plan.observability.O1, study.observability(grid).O1
                print(
                    f"| {kind} | {measured} | {plan.tip_prior_um:.1f} | {plan.tip_std_um:.2f} | {random_um(study):.2f} "
                    f"| {study.tip_std_um(grid):.2f} | {O1[0]:.2f} | {O1[1]:.2f} |"
                )


if __name__ == "__main__":
    run_limited(main, POSES=10, KINDS=dict(list(KINDS.items())[:1]))
