"""Recordings as a person may change them without changing what they say: other order, unit, frame, useless columns.

Each change takes a `RecordingFile` and returns another. They are written by hand here, not by `write_recording`, which
would refuse some of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.units import UM_PER_MM

AXES = ("x", "y", "z")
# Columns that are no quantities.
FIXED = (
    *("time_", "session", "visit", "point", "ball", "pin", "skew", "scale_", "joint_", "frame_", "approach_"),
    *("commanded_", "reference_", "model_", "d_"),
)
# Before the name of a column's copy; by how much a row's copy is later, s.
COPY, COPY_S = "again_", 1e-3
# Other units, with the factor and the offset of their numbers.
OTHER_UNITS = {"degC": ("K", 1.0, 273.15), "V": ("mV", 1000.0, 0.0), "A": ("mA", 1000.0, 0.0)}


@dataclass(frozen=True, eq=False)
class RecordingFile:
    """What stands in NAME.csv and NAME.yaml, and in a file of formula effects.

    columns : (N,) by name, nan for an empty cell.  formulas : declarations; empty for the library that comes along.
    """

    columns: Mapping[str, FloatArray]
    sidecar: Mapping[str, Any]
    formulas: tuple[Mapping[str, Any], ...] = ()

    @property
    def rows(self) -> int:
        """N."""
        return len(next(iter(self.columns.values())))

    @property
    def reference_columns(self) -> list[str]:
        """The measured coordinates."""
        return [name for name in self.columns if name.startswith("reference_")]

    def with_columns(self, columns: Mapping[str, FloatArray]) -> RecordingFile:
        """Some columns replaced or, at the end, added."""
        return replace(self, columns={**self.columns, **columns})

    def write(self, path: Path) -> Path:
        """Write the CSV file `path` and its sidecar."""
        lines = [",".join(self.columns)]
        lines += [",".join(map(_cell, row)) for row in zip(*self.columns.values(), strict=True)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        path.with_suffix(".yaml").write_text(yaml.safe_dump(dict(self.sidecar), sort_keys=False), encoding="utf-8")
        return path


def read_file(path: Path, formulas: tuple[Mapping[str, Any], ...] = ()) -> RecordingFile:
    """A recording as it stands on disk."""
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    cells = [line.split(",") for line in lines]
    columns = {
        name: np.array([float(row[k]) if row[k] else np.nan for row in cells])
        for k, name in enumerate(header.split(","))
    }
    return RecordingFile(columns, yaml.safe_load(path.with_suffix(".yaml").read_text(encoding="utf-8")), formulas)


def _cell(value: float) -> str:
    return "" if np.isnan(value) else repr(float(value)).removesuffix(".0")


Change = Callable[[RecordingFile], RecordingFile]


def add_constant(*offset_um: float) -> Change:
    """The same error more in every row, along each measured coordinate."""

    def change(file: RecordingFile) -> RecordingFile:
        names = file.reference_columns
        return file.with_columns(
            {name: file.columns[name] + offset / UM_PER_MM for name, offset in zip(names, offset_um, strict=False)}
        )

    return change


def shuffle_rows(seed: int) -> Change:
    """Rows in another order, each with its time, within their session."""

    def change(file: RecordingFile) -> RecordingFile:
        session = file.columns.get("session", np.zeros(file.rows))
        order = np.lexsort((np.random.default_rng(seed).permutation(file.rows), session))
        return replace(file, columns={name: values[order] for name, values in file.columns.items()})

    return change


def shuffle_columns(seed: int) -> Change:
    """Columns in another order."""

    def change(file: RecordingFile) -> RecordingFile:
        names = list(file.columns)
        order = np.random.default_rng(seed).permutation(len(names))
        return replace(file, columns={names[k]: file.columns[names[k]] for k in order})

    return change


def other_unit(old: str, new: str, factor: float = 1.0, offset: float = 0.0) -> Change:
    """A quantity in another unit: its column under a new name, times a factor, then shifted; in the formulas too."""
    in_old_unit = f"(({new} - {offset}) / {factor})"

    def change(file: RecordingFile) -> RecordingFile:
        columns = {
            new if name == old else name: factor * values + offset if name == old else values
            for name, values in file.columns.items()
        }
        formulas = yaml.safe_dump(list(file.formulas)).replace(old, in_old_unit)
        return replace(file, columns=columns, formulas=tuple(yaml.safe_load(formulas)))

    return change


def reference_in(unit: str, factor: float) -> Change:
    """The reference of an external machine in another unit, all its numbers times a factor, parameters likewise."""

    def change(file: RecordingFile) -> RecordingFile:
        reference = file.sidecar["reference"]
        old = reference["unit"]
        columns = {
            name.removesuffix(old) + unit if name.endswith(f"_{old}") else name: values
            * (factor if name.endswith(f"_{old}") else 1.0)
            for name, values in file.columns.items()
        }
        reference = {**reference, "unit": unit, "sigma": factor * reference["sigma"]}
        formulas = tuple({**formula, "parameters": in_unit(formula["parameters"], old)} for formula in file.formulas)
        return RecordingFile(columns, {**file.sidecar, "reference": reference}, formulas)

    def in_unit(parameters: Mapping[str, Any], old: str) -> dict[str, Any]:
        return {
            name: {
                **parameter,
                "unit": parameter["unit"].replace(old, unit),
                "plausible": [factor * end for end in parameter["plausible"]],
            }
            for name, parameter in parameters.items()
        }

    return change


def turn_frame(*degrees: float, shift_mm: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Change:
    """The reference in an instrument's frame, turned about x, y and z, or in a plane about z alone, and shifted."""

    def change(file: RecordingFile) -> RecordingFile:
        names = file.reference_columns
        n = len(names)
        angles = degrees if n == 3 else (0.0, 0.0, degrees[-1])
        R = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
        measured = np.column_stack([file.columns[name] for name in names])
        turned = measured @ R[:n, :n].T + np.array(shift_mm[:n])
        return file.with_columns(dict(zip(names, turned.T, strict=True)))

    return change


def empty_cells(**row_by_column: int) -> Change:
    """Of some columns one cell without a value; rows from 0."""

    def change(file: RecordingFile) -> RecordingFile:
        columns = {}
        for name, row in row_by_column.items():
            columns[name] = file.columns[name].copy()
            columns[name][row] = np.nan
        return file.with_columns(columns)

    return change


def add_useless_columns(seed: int, copied: str) -> Change:
    """Columns that have nothing to say: noise, a constant, a copy, the number of the row, numbers of batches."""

    def change(file: RecordingFile) -> RecordingFile:
        rng = np.random.default_rng(seed)
        return file.with_columns(
            {
                "voltage_mains_V": rng.normal(230, 2, file.rows),
                "pressure_supply_bar": np.full(file.rows, 6.0),
                "copy_of_quantity_1": file.columns[copied].copy(),
                "number_of_row_1": np.arange(file.rows) + 1.0,
                "batch_1": rng.integers(100_000, 100_020, file.rows).astype(float),
            }
        )

    return change


def move_rows(seed: int, share: float, most_um: float, as_run: bool = False) -> Change:
    """A share of the rows moved by up to `most_um` along each coordinate, here and there or in one run."""

    def change(file: RecordingFile) -> RecordingFile:
        rng = np.random.default_rng(seed)
        count = max(round(share * file.rows), 1)
        begin = int(rng.integers(0, file.rows - count))
        rows = np.arange(begin, begin + count) if as_run else rng.choice(file.rows, count, replace=False)
        columns = {}
        for name in file.reference_columns:
            columns[name] = file.columns[name].copy()
            columns[name][rows] += rng.uniform(-most_um, most_um, count) / UM_PER_MM
        return file.with_columns(columns)

    return change


def move_origin(seconds: float) -> Change:
    """The clock began earlier, as where seconds count from 1970."""
    return lambda file: file.with_columns({"time_s": file.columns["time_s"] + seconds})


def double_rows(file: RecordingFile) -> RecordingFile:
    """Every row at rest twice; a copy is COPY_S later, as no two rows may have one time.

    Rows of a motion stay alone: a copy of them would say that the machine stood still.
    """
    point = file.columns.get("point", np.zeros(file.rows))
    order = np.sort(np.concatenate([np.arange(file.rows), np.flatnonzero(~np.isnan(point))]))
    is_copy = np.diff(order, prepend=-1) == 0
    columns = {name: values[order] for name, values in file.columns.items()}
    if "time_s" in columns:
        columns["time_s"] = columns["time_s"] + COPY_S * is_copy
    return replace(file, columns=columns)


def double_columns(file: RecordingFile) -> RecordingFile:
    """Every quantity twice, under another name, in the rows and at machine zero."""
    doubled = file.with_columns({f"{COPY}{name}": file.columns[name].copy() for name in quantities(file)})
    at_zero = file.sidecar.get("quantities_at_zero")
    if at_zero is None:
        return doubled
    copies = {f"{COPY}{name}": value for name, value in at_zero.items()}
    return replace(doubled, sidecar={**file.sidecar, "quantities_at_zero": {**at_zero, **copies}})


def in_other_units(file: RecordingFile) -> RecordingFile:
    """Every quantity whose unit is in OTHER_UNITS in that one, in the formulas too, but those that a library needs.

    A column temperature_..._K would be refused, with how to convert it: it gets a name of its own.
    """
    for name in quantities(file):
        if name in file.sidecar.get("quantities_at_zero", ()):
            continue
        for old, (new, factor, offset) in OTHER_UNITS.items():
            if name.endswith(f"_{old}"):
                stem = name.removesuffix(old).removeprefix("temperature_")
                file = other_unit(name, stem + new, factor, offset)(file)
                break
    return file


def quantities(file: RecordingFile) -> list[str]:
    """The columns whose meaning a recording's format does not fix, and temperatures, forces and weather."""
    return [name for name in file.columns if not name.startswith(FIXED)]
