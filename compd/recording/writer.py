"""Writing a recording, as CSV or as Parquet: both files whole, or neither."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compd.arrays import FloatArray
from compd.columns import TEXT_ID_COLUMNS, decimals, is_covariate, number_text, parse_name
from compd.errors import Problem, RecordingError
from compd.files import Content, write_files
from compd.recording.parquet_writer import arrow_batch, arrow_schema, write_parquet
from compd.recording.sidecar import sidecar_text
from compd.table_file import PARQUET, SUFFIXES


def write_recording(
    path: Path, columns: Mapping[str, ArrayLike], sidecar: Mapping[str, Any], overwrite: bool = False
) -> None:
    """Write NAME.csv or NAME.parquet (`path`) and NAME.yaml beside it, both whole or neither.

    Parameters
    ----------
    columns : name with unit -> (N,) numbers in that unit, nan (an empty cell) where nothing was measured; of ids of
        points, balls, pins and reflectors texts as well, "" for an empty cell.
    sidecar : what the YAML file is to hold, as `sidecar_contents` returns it.
    overwrite : whether existing files are replaced.

    Raises
    ------
    RecordingError
        For names that are not the format's, unequal lengths, infinite numbers, a time_s that does not rise, an
        existing file without `overwrite`, a disk that does not take the files, and Parquet without pyarrow.
    """
    texts = {name: values for name, values in columns.items() if name in TEXT_ID_COLUMNS and _is_text(values)}
    arrays = {name: np.asarray(v, dtype=np.float64) for name, v in columns.items() if name not in texts}
    lengths = {name: np.zeros(np.shape(values)) for name, values in texts.items()}
    if problems := _problems(path, {**arrays, **lengths}, overwrite):
        raise RecordingError(problems)
    cells = {name: np.asarray(texts[name]) if name in texts else _rounded(name, arrays[name]) for name in columns}
    table = _parquet(path, cells, texts) if path.suffix == PARQUET else _csv_text(cells)
    write_recording_files({path.with_suffix(".yaml"): sidecar_text(sidecar, path.parent), path: table})


def write_recording_files(contents: Mapping[Path, Content]) -> None:
    """Write files of a recording, all whole or none; the last names the directory in messages.

    Raises RecordingError if the disk does not take them.
    """
    try:
        # everyone who works on the recording must be able to read it
        write_files(contents, mode=0o644)
    except OSError as error:
        directory = list(contents)[-1].parent
        raise RecordingError.of(str(directory), f"cannot be written to: {error.strerror}") from error


def _problems(path: Path, arrays: Mapping[str, FloatArray], overwrite: bool) -> list[Problem]:
    problems = [
        Problem(str(target), "is there already", next_step="choose another name, or remove it")
        for target in (path, path.with_suffix(".yaml"))
        if target.exists() and not overwrite
    ]
    if path.suffix not in SUFFIXES:
        what = "a recording is NAME.csv or NAME.parquet"
        problems.append(Problem(str(path), what, value=path.suffix, allowed=", ".join(SUFFIXES)))
    for name, values in arrays.items():
        where = f"{path}: column {name}"
        if parse_name(name) is None and not is_covariate(name):
            problems.append(
                Problem(where, "no column of the format", value=name, allowed="see the format, or <name>_<unit>")
            )
        if values.ndim != 1 or len(values) != len(next(iter(arrays.values()))):
            problems.append(Problem(where, "not as long as the others", value=str(values.shape)))
        if np.isinf(values).any():
            problems.append(Problem(where, "holds an infinite number", allowed="a number, or nan for an empty cell"))
    time_s = arrays.get("time_s")
    if time_s is not None and (np.isnan(time_s).any() or (np.diff(_rounded("time_s", time_s)) <= 0).any()):
        problems.append(Problem(f"{path}: column time_s", "does not rise by a microsecond every row"))
    return problems


def _is_text(values: ArrayLike) -> bool:
    return np.asarray(values).dtype.kind in "OU"


def _rounded(name: str, values: FloatArray) -> FloatArray:
    """Values with the decimals of their column."""
    places = decimals(name)
    return values if places is None else np.round(values, places)


def _parquet(path: Path, columns: Mapping[str, NDArray[Any]], texts: Collection[str]) -> Content:
    """The writer of the columns as Parquet. texts : names of those that are text."""
    schema = arrow_schema(path, columns, texts)
    block = {name: [cell or None for cell in v.tolist()] if name in texts else v for name, v in columns.items()}
    return lambda file: write_parquet(file, path, schema, [arrow_batch(path, schema, block)])


def _csv_text(columns: Mapping[str, NDArray[Any]]) -> str:
    """The columns as CSV; a cell is empty for nan."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*map(_cells, columns.values()), strict=True))
    return text.getvalue()


def _cells(values: NDArray[Any]) -> list[str]:
    cells: list[Any] = values.tolist()
    if _is_text(values):
        return cells
    return ["" if math.isnan(value) else number_text(value) for value in cells]
