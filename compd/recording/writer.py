"""Writing a recording: both files whole, or neither."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import ArrayLike

from compd.arrays import FloatArray
from compd.errors import Problem, RecordingError
from compd.files import write_files
from compd.recording.columns import is_covariate, known
from compd.units import unit_of

# Decimals by unit: a picometre, a microsecond, a tenth of a nanoradian. Finer than any gauge, and coarse enough
# that a conversion from mm to um leaves no digits of its own behind. Other units are written in full.
DECIMALS = {"mm": 9, "um": 6, "s": 6, "rad": 10}


def write_recording(
    path: Path, columns: Mapping[str, ArrayLike], sidecar: Mapping[str, Any], overwrite: bool = False
) -> None:
    """Write NAME.csv (`path`) and NAME.yaml beside it.

    columns : name with unit -> (N,) numbers in that unit, nan (an empty cell) where nothing was measured.
    sidecar : what the YAML file is to hold.

    Both are written beside their place, flushed to the disk and then renamed, the sidecar first: a reader never
    sees half a file, and a failure leaves what was there. Raises RecordingError for names that are not the
    format's, unequal lengths, infinite numbers, a time_s that is missing or does not rise, an existing file
    without `overwrite`, and a disk that does not take the files.
    """
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in columns.items()}
    if problems := _problems(path, arrays, overwrite):
        raise RecordingError(problems)
    cells = [_cells(name, values) for name, values in arrays.items()]
    lines = [",".join(arrays), *map(",".join, zip(*cells, strict=True))]
    csv_text = "\n".join(lines) + "\n"
    yaml_text = yaml.safe_dump(dict(sidecar), sort_keys=False, allow_unicode=True)
    try:
        # whoever works on the recording must be able to read it
        write_files({path.with_suffix(".yaml"): yaml_text, path: csv_text}, mode=0o644)
    except OSError as error:
        raise RecordingError(Problem(where=str(path.parent), what=f"cannot be written to: {error.strerror}")) from error


def _problems(path: Path, arrays: Mapping[str, FloatArray], overwrite: bool) -> list[Problem]:
    problems = [
        Problem(where=str(target), what="is there already", next_step="choose another name, or remove it")
        for target in (path, path.with_suffix(".yaml"))
        if target.exists() and not overwrite
    ]
    if path.suffix != ".csv":
        problems.append(Problem(where=str(path), what="a recording is NAME.csv", value=path.suffix, allowed=".csv"))
    for name, values in arrays.items():
        where = f"{path}: column {name}"
        if known(name) is None and not is_covariate(name):
            problems.append(
                Problem(
                    where=where, what="no column of the format", value=name, allowed="see the format, or <name>_<unit>"
                )
            )
        if values.ndim != 1 or len(values) != len(next(iter(arrays.values()))):
            problems.append(Problem(where=where, what="not as long as the others", value=str(values.shape)))
        if np.isinf(values).any():
            problems.append(
                Problem(where=where, what="holds an infinite number", allowed="a number, or nan for an empty cell")
            )
    time_s = arrays.get("time_s")
    if time_s is None or np.isnan(time_s).any() or (np.diff(_rounded("time_s", time_s)) <= 0).any():
        problems.append(
            Problem(where=f"{path}: column time_s", what="is missing, or does not rise by a microsecond every row")
        )
    return problems


def _rounded(name: str, values: FloatArray) -> FloatArray:
    """Values with the decimals of their unit."""
    column = known(name)
    unit = column.unit if column else unit_of(name)
    return np.round(values, DECIMALS[unit]) if unit in DECIMALS else values


def _cells(name: str, values: FloatArray) -> list[str]:
    """A column as it is written: the shortest text that reads back as the same number, without a needless ".0"."""
    return ["" if math.isnan(value) else repr(value).removesuffix(".0") for value in _rounded(name, values).tolist()]
