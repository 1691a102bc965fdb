"""A controller without scales: it commands poses, drives by the drawing, and follows what compd corrects."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from compd.client import Client, connect
from compd.configuration import load
from compd.simulation import ControlClient, Mechanism
from tests.support.patience import PATIENCE_S

# Between two targets while it moves, as a slow controller does; a setpoint for a target is there a few cycles later.
TARGET_EVERY_S = 0.02
# So often a pose at rest is corrected anew: limits let a correction grow step by step.
PASSES = 3


class PoseController:
    """Streams the pose where its drives are, and moves them by the correction that it gets for it."""

    def __init__(self, client: Client, socket: Path, mechanism: Mechanism) -> None:
        self._client, self._socket, self._mechanism = client, socket, mechanism
        self._number = 0
        self._added_mm: NDArray[np.float64] = np.zeros(mechanism.scales)

    def drive(self, machine: ControlClient, goal_mm: Sequence[float]) -> None:
        """To the pose that the drawing has with the drives at goal_mm (m,), corrected."""
        for _ in range(PASSES):
            self._move(machine, np.array(goal_mm))
            self._added_mm = self._drives_mm(self._answer()) - goal_mm
        self._move(machine, np.array(goal_mm))

    def _move(self, machine: ControlClient, goal_mm: NDArray[np.float64]) -> None:
        end_mm = goal_mm + self._added_mm
        while True:
            truth = machine.ask("DRIVE", scale_mm=end_mm.tolist())
            there = not truth["moving"] and np.abs(truth["scale_mm"] - end_mm).max() < 1e-6
            self._tell(goal_mm if there else np.subtract(truth["scale_mm"], self._added_mm))
            if there:
                return
            threading.Event().wait(TARGET_EVERY_S)

    def _tell(self, drives_mm: NDArray[np.float64]) -> None:
        self._number += 1
        tip_mm, turn_rad = self._mechanism.told_pose(drives_mm, self._mechanism.posture0)
        self._client.target(tip_mm.tolist(), turn_rad.tolist(), time_s=time.monotonic(), id=self._number)

    def _answer(self) -> dict[str, Any]:
        # who reads only now and then would fall behind, and be disconnected
        with connect(self._socket, PATIENCE_S) as observer:
            return next(s for s in observer.watch() if s["valid"] and s.get("target_id") == self._number)

    def _drives_mm(self, setpoint: dict[str, Any]) -> NDArray[np.float64]:
        """Where the drawing has the drives (m,) at the corrected pose."""
        drawn = self._mechanism
        told_B0 = np.add(setpoint["tip_B0_mm"], setpoint["tip_correction_mm"])
        correction = Rotation.from_rotvec(drawn.rotation_M_B0 @ setpoint["rotation_correction_rad"])
        attitude = correction * Rotation.from_rotvec(setpoint["rotation_M_rad"])
        turn = attitude * Rotation.from_matrix(drawn.posture0[1:].T).inv()
        posture = drawn.posture_at(drawn.rotation_M_B0 @ told_B0 + drawn.origin_B0_M, turn.as_rotvec())
        return drawn.scales_at(posture)


@contextmanager
def pose_controller(socket: Path, configuration: Path) -> Iterator[PoseController]:
    """The controller of the daemon on this socket, until the block ends."""
    with connect(socket, PATIENCE_S) as client:
        yield PoseController(client, socket, Mechanism(load(configuration).geometry))
