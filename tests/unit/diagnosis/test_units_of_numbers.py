"""Numbers are in the unit that they are printed in, whatever unit of an angle a recording has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import compd
from compd.units import UNIT_KINDS

ANGLES = UNIT_KINDS[2]
IA_ARCSEC, TF_ARCSEC = -150.0, 60.0


def stars(directory: Path, unit: str) -> Path:
    """60 stars, of which the same errors are given in any unit."""
    rng = np.random.default_rng(4)
    azimuth, elevation = rng.uniform(0, 360, 60), rng.uniform(20, 80, 60)
    error = np.stack([-IA_ARCSEC * np.cos(np.radians(elevation)), -TF_ARCSEC * np.cos(np.radians(elevation))], axis=1)
    error = (error + rng.normal(0, 1, (60, 2))) * ANGLES["arcsec"] / ANGLES[unit]
    table = np.column_stack([60.0 * np.arange(60), azimuth, elevation, np.zeros((60, 2)), error])
    names = [f"{kind}_{axis}_{unit}" for kind in ("model", "reference") for axis in "xy"]
    path = directory / f"stars_{unit}.csv"
    header = ",".join(["time_s", "azimuth_deg", "elevation_deg", *names])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.12g")
    path.with_suffix(".yaml").write_text(
        f"format: 3\nmachine: external\nreference: {{quantity: tool_position, unit: {unit}, frame: machine}}\n",
        encoding="utf-8",
    )
    return path


@pytest.mark.parametrize("unit", ["arcsec", "deg", "mrad", "urad"])
def test_terms_in_arcsec_are_so_beside_every_unit(unit: str, tmp_path: Path) -> None:
    diagnosis = compd.diagnose(stars(tmp_path, unit), effects="telescope")
    found = {number.name: number for step in diagnosis.steps for number in step.parameters}
    assert found["IA"].value == pytest.approx(IA_ARCSEC, abs=3)
    assert found["TF"].value == pytest.approx(TF_ARCSEC, abs=3)
    assert {number.unit for number in found.values()} == {"arcsec"}
