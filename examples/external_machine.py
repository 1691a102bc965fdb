"""A machine that compd does not know: bring your own model's prediction, and learn what your model lacks.

    python examples/external_machine.py [DIRECTORY]

The machine is a small gantry whose y guide is not quite square to x. Its model knows that, but not that the spindle
grows when it runs warm. A recording needs time, the prediction of your model (model_x_mm ...), the measured place
(reference_x_mm ...), and everything else that you measured; `machine: external` in the sidecar says that it is so.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import compd

SQUARENESS = 40e-6  # rad
SPINDLE_UM_PER_K = 1.3  # what the model does not know: the growth of the spindle
TRACKER_UM = 0.5  # standard uncertainty per axis

SIDECAR = f"machine: external\nreference: {{quantity: tool_position, frame: machine, sigma_um: {TRACKER_UM}}}\n"


def my_model_mm(axes_mm: np.ndarray) -> np.ndarray:
    """(N, 3) where the tip is by the model of the machine's builder, from the axes' scales (N, 3)."""
    x, y, z = axes_mm.T
    return np.column_stack([x + SQUARENESS * y, y, z])


def measure(path: Path, seed: int) -> None:
    """Write a day's recording: 300 points in four sessions, while the machine warms up and cools down."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(300) * 60.0
    axes_mm = rng.uniform([0, 0, -150], [400, 300, 0], (300, 3))
    spindle_degC = 20 + 6 * (1 - np.cos(time_s / 3600 + rng.uniform(0, 6))) + rng.normal(0, 0.05, 300)
    room_degC = 20 + 0.8 * np.sin(time_s / 7200 + rng.uniform(0, 6))
    tip_mm = my_model_mm(axes_mm)
    tip_mm[:, 2] -= SPINDLE_UM_PER_K * 1e-3 * (spindle_degC - 20)
    columns = {
        "time_s": time_s,
        "session": 1 + np.arange(300) // 75,
        **{f"model_{axis}_mm": values for axis, values in zip("xyz", my_model_mm(axes_mm).T, strict=True)},
        **{f"reference_{axis}_mm": values + rng.normal(0, TRACKER_UM / 1e3, 300)
           for axis, values in zip("xyz", tip_mm.T, strict=True)},
        "temperature_spindle_degC": spindle_degC,
        "temperature_room_degC": room_degC,
    }  # fmt: skip
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, fmt="%.6f", delimiter=",", header=",".join(columns), comments="")
    path.with_suffix(".yaml").write_text(SIDECAR, encoding="utf-8")


def main(directory: Path) -> None:
    measure(directory / "monday.csv", seed=1)
    measure(directory / "tuesday.csv", seed=2)
    monday, tuesday = (compd.open_recording(directory / name) for name in ("monday.csv", "tuesday.csv"))
    print(compd.compare(monday).verdict)
    diagnosis = compd.diagnose(monday)
    print(f"{diagnosis.verdict}: {diagnosis.summary}")
    model = None
    for formula in diagnosis.depends_on[0].formula_effects:
        print(f"    {formula['id']}, axis {formula['axis']}: {formula['formula']}")
        model = compd.add_effect(model, formula, monday)
    before, after = compd.compare(tuesday), compd.compare(tuesday, model)
    print(f"tuesday: {before.rms_um:.3f} um -> {after.rms_um:.3f} um, noise floor {after.floor.um:.3f} um")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary))
