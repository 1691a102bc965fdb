"""Recordings of a machine whose hidden effects are known, measured by any kind of reference with known noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compd.comparison import AlignedRecording
from compd.comparison.alignment.align_recording import align_recording
from compd.comparison.alignment.aligned_recording import effect_deltas
from compd.configuration import Configuration, load, shipped_configuration
from compd.model.effects import FittedEffect
from compd.model.library import load_library
from compd.recording import read_recording, write_recording

Floats = NDArray[np.float64]
SIGMA_UM = 0.15
GAUGE_SIGMA_UM = 0.015
PLACES = ("room", "link_1", "link_2", "link_3", "base", "frame", "platform", "tool", "plate_top", "plate_bottom")


def tripod() -> Configuration:
    return load(shipped_configuration("tripod-cmm.yaml"))


def hidden(effect: str, *values: float, **shape: float) -> FittedEffect:
    """A library effect with its numbers in the unit that people read."""
    declared = load_library()[effect]
    theta = [column.parameter.to_theta(value) for column, value in zip(declared.columns(3), values, strict=True)]
    return FittedEffect(declared, np.array(theta), shape)


def gauges(rows: int, seed: int, links: int = 3, joints: int = 9) -> dict[str, Floats]:
    """Columns of a recording's gauges, in four sessions; every third row repeats the row before: the same visit."""
    rng = np.random.default_rng(seed)
    repeat = np.arange(rows) % 3 == 2
    source = np.arange(rows) - repeat
    hours = np.arange(rows) * 25.0 / 3600.0
    columns: dict[str, Floats] = {
        "time_s": np.arange(rows) * 25.0,
        "session": 1.0 + np.arange(rows) * 4 // rows,
        "visit": np.cumsum(~repeat).astype(float),
    }
    for i in range(1, links + 1):
        columns[f"scale_{i}_mm"] = np.round(rng.uniform(-60, 60, rows), 6)[source]
        columns[f"approach_{i}"] = rng.choice([-1.0, 1.0], rows)[source]
    for k in range(1, joints + 1):
        columns[f"joint_{k}_um"] = rng.uniform(-8, 8, rows)[source]
    for name in ("t1", "t2", "t3", "u1", "u2", "u3", "u4", "u5", "u6"):
        columns[f"frame_{name}_um"] = np.cumsum(rng.normal(0, 0.3, rows))[source]
    for place in PLACES:
        walk = np.cumsum(rng.normal(0, 0.05, rows))
        columns[f"temperature_{place}_degC"] = 20 + walk[source] + 0.3 * np.sin(hours + rng.uniform(0, 6))
    for axis in "xyz":
        loaded = rng.random(rows) < 0.4
        columns[f"force_{axis}_N"] = (loaded * rng.uniform(-40, 40, rows))[source]
    columns["humidity_pct"] = 50 + np.cumsum(rng.normal(0, 0.4, rows))[source]
    return columns


def record(
    directory: Path,
    columns: Mapping[str, Floats],
    effects: Sequence[FittedEffect] = (),
    *,
    name: str = "run",
    sigma_um: float = SIGMA_UM,
    seed: int = 1,
    machine: str = "tripod-cmm",
    reference: Mapping[str, Any] | None = None,
    configuration: Configuration | None = None,
    axes: str = "xyz",
) -> Path:
    """Write NAME.csv and NAME.yaml: the tip that these gauges and effects make, with noise; gauges have theirs."""
    configuration = configuration or tripod()
    sidecar = {
        "machine": machine,
        "reference": dict(reference or {"quantity": "tool_position", "frame": "machine", "sigma_um": sigma_um}),
    }
    path = directory / f"{name}.csv"
    rng = np.random.default_rng(seed)
    truth_mm = tips_mm(directory, columns, effects, configuration, machine)
    measured = {f"reference_{axis}_mm": truth_mm[:, "xyz".index(axis)] for axis in axes}
    measured = {key: value + rng.normal(0, sigma_um / 1e3, len(value)) for key, value in measured.items()}
    read = {
        key: np.round(value + rng.normal(0, GAUGE_SIGMA_UM, len(value)), 2) if key.endswith("_um") else value
        for key, value in columns.items()
    }
    write_recording(path, {**read, **measured}, sidecar, overwrite=True)
    return path


def tips_mm(
    directory: Path,
    columns: Mapping[str, Floats],
    effects: Sequence[FittedEffect],
    configuration: Configuration,
    machine: str,
) -> Floats:
    """(N, 3) where a perfect reference sees the tip."""
    aligned = _blank(directory, columns, configuration, machine)
    _, added = effect_deltas(effects, aligned.rows)
    return aligned.predicted_mm(added)


def _blank(
    directory: Path, columns: Mapping[str, Floats], configuration: Configuration, machine: str
) -> AlignedRecording:
    path = directory / "blank.csv"
    nothing = {f"reference_{axis}_mm": np.arange(len(columns["time_s"])) * 1e-3 for axis in "xyz"}
    sidecar = {"machine": machine, "reference": {"quantity": "tool_position", "frame": "machine"}}
    write_recording(path, {**columns, **nothing}, sidecar, overwrite=True)
    return align_recording(read_recording(path, configuration), configuration)


def aligned(path: Path, configuration: Configuration | None = None) -> AlignedRecording:
    """The recording on the shipped tripod, or on another machine."""
    configuration = configuration or tripod()
    return align_recording(read_recording(path, configuration), configuration)
