"""Recordings of the drawing's tripod on which effects of the library act, with noise and outliers, for tests."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording
from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.alignment.aligned_recording import effect_deltas
from compd.configuration import load, shipped_configuration
from compd.model.effects import FittedEffect
from compd.model.library import load_library
from compd.recording import read_recording, write_recording

LIBRARY = load_library()
NOISE_UM = 0.15
PLACES = ("room", "link_1", "link_2", "link_3", "base", "frame", "platform", "tool", "plate_top", "plate_bottom")
SIDECAR = {
    "machine": "tripod-cmm",
    "reference": {"quantity": "tool_position", "frame": "machine", "sigma_um": NOISE_UM},
}


def campaign(seed: int, visits: int = 160, sessions: int = 4) -> dict[str, FloatArray]:
    """Columns without a reference: 40 points, slow weather of its own in each place, loads, both directions.

    Every fourth visit is repeated.
    """
    rng = np.random.default_rng(seed)
    points = rng.uniform(-70, 70, (40, 3))
    visit = np.repeat(np.arange(visits), np.where(np.arange(visits) % 4 == 0, 2, 1))
    rows = len(visit)
    point = rng.integers(0, 40, visits)[visit]
    time_s = np.cumsum(np.where(np.diff(visit, prepend=-1) > 0, 40.0, 2.0))
    columns: dict[str, FloatArray] = {
        "time_s": time_s,
        "session": 1.0 + visit * sessions // visits,
        "visit": 1.0 + visit,
        "point": 1.0 + point,
    }
    columns |= {f"scale_{i + 1}_mm": points[point, i] for i in range(3)}
    columns |= {f"joint_{k}_um": _wander(rng, time_s, 2.0) for k in range(1, 10)}
    columns |= {f"frame_{name}_um": _wander(rng, time_s, 1.0) for name in ("t1", "t2", "t3", *_distances())}
    columns |= {f"temperature_{place}_degC": 20 + _wander(rng, time_s, 1.0) for place in PLACES}
    columns |= {"pressure_hPa": 1013 + _wander(rng, time_s, 6.0), "humidity_pct": 50 + _wander(rng, time_s, 8.0)}
    loaded = (rng.uniform(size=visits) < 0.5)[visit]
    columns |= {f"force_{axis}_N": loaded * rng.uniform(-40, 40, visits)[visit] for axis in "xyz"}
    columns |= {f"approach_{i}": rng.choice((-1.0, 1.0), visits)[visit] for i in (1, 2, 3)}
    assert all(len(values) == rows for values in columns.values())
    return columns


def _distances() -> tuple[str, ...]:
    return tuple(f"u{k}" for k in range(1, 7))


def _wander(rng: np.random.Generator, time_s: FloatArray, size: float) -> FloatArray:
    """A slow curve of three waves, root mean square `size`."""
    periods_s = rng.uniform(1500, 9000, 3)
    waves = np.sin(2 * np.pi * time_s[:, None] / periods_s + rng.uniform(0, 2 * np.pi, 3))
    return np.asarray(size * waves.sum(axis=1) / np.sqrt(1.5))


def record_with_effects(
    path: Path,
    seed: int,
    effects: Mapping[str, tuple[float, ...]],
    *,
    extra_um: FloatArray | float = 0.0,
    outliers: int = 0,
    visits: int = 160,
) -> AlignedRecording:
    """A recording of a machine on which `effects` act (theta by id; compliances for stiffnesses), written and read.

    extra_um : (N, 3) what else the reference shows.  outliers : number of rows, every twentieth, that are off by 6 um.
    """
    columns = campaign(seed, visits)
    rng = np.random.default_rng([seed, 1])
    count = len(columns["time_s"])
    reference = {f"reference_{axis}_mm": np.zeros(count) for axis in "xyz"}
    configuration = load(shipped_configuration("tripod-cmm.yaml"))
    write_recording(path, columns | reference, SIDECAR, overwrite=True)
    aligned = align_recording(read_recording(path, configuration), configuration)
    fitted = [FittedEffect(LIBRARY[name], np.array(theta), dict(_shape(name))) for name, theta in effects.items()]
    _, added = effect_deltas(fitted, aligned.rows)
    tip_mm = aligned.predicted_mm(added) + 1e-3 * (extra_um + NOISE_UM * rng.standard_normal((count, 3)))
    tip_mm[12 : 12 + 20 * outliers : 20] += 6e-3
    for axis, values in zip("xyz", tip_mm.T, strict=True):
        reference[f"reference_{axis}_mm"] = values
    write_recording(path, columns | reference, SIDECAR, overwrite=True)
    return align_recording(read_recording(path, configuration), configuration)


def _shape(name: str) -> dict[str, float]:
    shapes = {
        "link_expansion_lag": {"tau": 900.0},
        "friction_hysteresis": {"d": 20.0, "r": 0.0},
        "link_sag": {"n": 3.0},
        "joint_runout": {"z": 1.0},
    }
    return shapes.get(name, {})
