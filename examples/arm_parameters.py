"""The parameters of your own kinematic model as effects: which of a robot arm's lengths and joint zeros are wrong?

    python examples/arm_parameters.py [DIRECTORY]

For each parameter of the model the recording has the derivative of the prediction, a column per axis: d_forearm_x_mm,
d_forearm_y_mm, d_forearm_z_mm. An effect with `sensitivity: forearm` is these columns times a number that is fitted.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

import compd

# Where each joint turns about, and from it to the next joint (from the last one to the tip), at zero; x forward, z up.
AXES = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]])
LINKS_MM = np.array([[25, 0, 400], [0, 0, 455], [0, 0, 35], [420, 0, 0], [80, 0, 0], [120, 0, 60]], dtype=float)
# By parameter: its unit, and how far it may plausibly be off.
PARAMETERS = {**{f"zero_{i}": ("deg", 0.5) for i in range(1, 7)}, "upper_arm": ("mm", 3.0), "forearm": ("mm", 3.0)}
TRUTH = {"zero_3": 0.04, "forearm": 0.6}
TRACKER_UM = 20.0  # standard uncertainty per axis
SIDECAR = f"machine: external\nreference: {{quantity: tool_position, frame: machine, sigma_um: {TRACKER_UM}}}\n"


def tip_mm(joints_deg: np.ndarray, **off: float) -> np.ndarray:
    """(N, 3) the tip from the joints' angles (N, 6) by the model, some of whose parameters are off."""
    longer = {1: [0, 0, off.get("upper_arm", 0.0)], 3: [off.get("forearm", 0.0), 0, 0]}
    angles_rad = np.deg2rad(joints_deg + [off.get(f"zero_{i}", 0.0) for i in range(1, 7)])
    tip = np.zeros((len(joints_deg), 3))
    for i in reversed(range(6)):
        tip = Rotation.from_rotvec(np.outer(angles_rad[:, i], AXES[i])).apply(tip + LINKS_MM[i] + longer.get(i, 0.0))
    return tip


def measure(path: Path, seed: int) -> None:
    """Write a recording of 150 poses: the model's prediction, its derivatives by the parameters, and the tracker."""
    rng = np.random.default_rng(seed)
    joints_deg = rng.uniform([-120, -40, -30, -150, -90, -150], [120, 40, 60, 150, 90, 150], (150, 6))
    tables = {"model": tip_mm(joints_deg)}
    tables["reference"] = tip_mm(joints_deg, **TRUTH) + rng.normal(0, TRACKER_UM / 1e3, (150, 3))
    for name in PARAMETERS:
        tables[f"d_{name}"] = (tip_mm(joints_deg, **{name: 1e-3}) - tip_mm(joints_deg, **{name: -1e-3})) / 2e-3
    columns = ["time_s", *(f"{name}_{axis}_mm" for name in tables for axis in "xyz")]
    table = np.column_stack([10.0 * np.arange(150), *tables.values()])
    np.savetxt(path, table, fmt="%.6f", delimiter=",", header=",".join(columns), comments="")
    path.with_suffix(".yaml").write_text(SIDECAR, encoding="utf-8")


def main(directory: Path) -> None:
    effects = [{"id": f"arm_{name}", "port": "reference", "sensitivity": name, "physics": f"The {name} is wrong.",
                "parameters": {name: {"unit": unit, "plausible": [-most, most], "source": "assembly of the arm"}}}
               for name, (unit, most) in PARAMETERS.items()]  # fmt: skip
    (directory / "arm-effects.yaml").write_text(yaml.safe_dump(effects, sort_keys=False), encoding="utf-8")
    monday, tuesday = directory / "monday.csv", directory / "tuesday.csv"
    measure(monday, seed=1)
    measure(tuesday, seed=2)
    diagnosis = compd.diagnose(monday, effects=directory / "arm-effects.yaml")
    print(f"{diagnosis.verdict}: {diagnosis.summary}")
    model = None
    for step in diagnosis.steps:
        model = compd.add_effect(model, step.effect, monday)
    for number in model.numbers() if model else ():
        print(f"    {number.parameter} = {number.value:.3f} +- {number.standard_error:.3f} {number.unit}")
    before, after = compd.compare(tuesday), compd.compare(tuesday, model)
    print(f"tuesday: {before.rms_um:.0f} um -> {after.rms_um:.1f} um, noise floor {after.floor.um:.1f} um")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary))
