"""Recordings of a hexapod's poses: the tip and the attitude."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from compd.comparison.alignment.aligned_recording import effect_deltas
from compd.configuration import Configuration, load, shipped_configuration
from compd.model import predict
from compd.recording import write_recording
from tests.support.measured import SIGMA_UM, aligned, gauges, record

SIGMA_URAD = 2.0


def hexapod() -> Configuration:
    return load(shipped_configuration("hexapod.yaml"))


def poses(
    directory: Path, effects: tuple[Any, ...] = (), *, moved: bool = False, sigma_urad: float | None = None
) -> Path:
    """A hexapod's poses with noise; moved: in an instrument's frame, by a target that is turned on the platform."""
    machine = hexapod()
    columns = gauges(150, 31, links=6, joints=len(machine.wiring.joint))
    for i in range(1, 7):
        columns[f"scale_{i}_mm"] = columns[f"scale_{i}_mm"] * 0.3
    plain = record(directory, columns, effects, machine="hexapod", configuration=machine, name="plain")
    first = aligned(plain, machine)
    _, added = effect_deltas(effects, first.rows)
    predicted = predict(first.model, first.rows, added)  # type: ignore[arg-type]
    rng = np.random.default_rng(8)
    noise = Rotation.from_rotvec(rng.normal(0, SIGMA_URAD * 1e-6, (150, 3)))
    attitude, tip_mm = noise * Rotation.from_matrix(predicted.rotation_M_P), first.measured_mm
    reference: dict[str, Any] = {"quantity": "tool_pose", "frame": "machine", "sigma_um": SIGMA_UM}
    reference["sigma_urad"] = sigma_urad or SIGMA_URAD
    if moved:
        frame = Rotation.from_rotvec([0.02, -0.4, 1.1])
        attitude = frame * attitude * Rotation.from_rotvec([0.7, 0.1, -0.2])
        tip_mm = frame.apply(tip_mm) + np.array([800.0, -300.0, 45.0])
        reference["frame"] = "instrument"
    measured = {f"reference_{axis}_mm": tip_mm[:, k] for k, axis in enumerate("xyz")}
    measured |= {f"reference_r{axis}_rad": attitude.as_rotvec()[:, k] for k, axis in enumerate("xyz")}
    path = directory / "poses.csv"
    write_recording(path, {**first.recording.columns, **measured}, {"machine": "hexapod", "reference": reference})
    return path
