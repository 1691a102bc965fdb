"""Calibrations from touches of planes oblique to {M}: each plane is a recording with one constant coordinate."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml

import compd
from compd.arrays import FloatArray
from tests.support.built_machines import NOISE_MM, REACH_MM, REACH_RAD, World, built, deviations, drawing, poses, record

TOUCHES = 60
# of each plane: the axis of {M} nearest to its normal, and the normal
NORMALS = {"x": [1.0, 0.2, -0.1], "y": [-0.15, 1.0, 0.1], "z": [0.1, -0.2, 1.0]}


def touches(
    world: World, rng: np.random.Generator, normal: FloatArray
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Poses of the built machine whose tip is in the plane through machine zero, but for the probe's noise."""
    while True:
        place, turn = rng.uniform(-0.7, 0.7, 3) * REACH_MM, rng.uniform(-1, 1, 3) * REACH_RAD
        beyond = NOISE_MM * rng.standard_normal()
        for _ in range(4):
            found = next(poses(world, [(place, turn)]), None)
            if found is None:
                break
            place = place - normal * (normal @ (found[1] - world.drawn.tip0_M) - beyond)
        if found is not None:
            yield found


def plane_recording(path: Path, world: World, rng: np.random.Generator, axis: str) -> Path:
    normal = np.array(NORMALS[axis]) / np.linalg.norm(NORMALS[axis])
    one = touches(world, rng, normal)
    rows = [",".join([*(repr(float(x)) for x in next(one)[0]), "0"]) for _ in range(TOUCHES)]
    names = [*(f"scale_{i + 1}_mm" for i in range(world.drawn.scales)), f"reference_{axis}_mm"]
    path.write_text("\n".join([",".join(names), *rows]) + "\n", encoding="utf-8")
    reference = {"quantity": "tool_position", "frame": "instrument", "sigma_um": 1e3 * NOISE_MM}
    sidecar = {"machine": world.name, "machine_file": f"{world.name}.yaml", "reference": reference}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(sidecar), encoding="utf-8")
    return path


@pytest.mark.parametrize("seed", [21, pytest.param(22, marks=[pytest.mark.long, pytest.mark.sample])])
def test_touches_of_three_oblique_planes_calibrate_all_but_the_scale_of_length(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    world = built(drawing("6-ups", tmp_path), rng)
    planes = [compd.open_recording(plane_recording(tmp_path / f"{axis}.csv", world, rng, axis)) for axis in NORMALS]
    other = compd.open_recording(record(tmp_path / "other.csv", world, rng, 60, noise=0.0))
    result = compd.calibrate(planes, other)
    assert result.sealed[0].after_rms_um < 0.65 * result.sealed[0].before_rms_um
    assert any("no scale of length" in warning for warning in result.warnings)
    off = deviations(world, planes[0], result)
    assert np.abs(off).max(initial=0.0) < 4.5
