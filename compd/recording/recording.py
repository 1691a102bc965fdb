"""A recording: raw readings of the machine beside an external reference, row by row, in the program's units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray, TextArray
from compd.columns import (
    COMMANDED_ATTITUDE_COLUMNS,
    COMMANDED_COLUMNS,
    frame_columns,
    joint_columns,
    scale_columns,
)
from compd.data_fault import DataFault
from compd.display_unit import MM_PER_RAD
from compd.errors import Problem
from compd.recording.ball_plate import BallPlate
from compd.recording.reference import Reference
from compd.recording.sample import RecordingSample
from compd.recording.sidecar import Sidecar
from compd.recording.visits import file_numbers
from compd.tables import id_texts
from compd.units import UM_PER_MM

# Without a `session` column, cross-validation leaves out blocks of time (the recording format).
BLOCKS = 8


class UsableRows(NamedTuple):
    """Complete rows.

    mask : (N,) bool.
    left_out : reason -> rows; each row counts once, under the first reason that applies.
    reason : (N,) text: why the row is left out, "" for one that is not.
    """

    mask: BoolArray
    left_out: Mapping[str, int]
    reason: TextArray

    def without(self, rows: BoolArray, reason: str) -> UsableRows:
        """Those that are not among `rows` (N,), which are left out for one more reason."""
        new = rows & self.mask
        if not new.any():
            return self
        return UsableRows(
            self.mask & ~new, {**self.left_out, reason: int(new.sum())}, np.where(new, reason, self.reason)
        )


@dataclass(frozen=True)
class Recording:
    """N rows of one recording. Lengths are mm (the file's um are converted), nan where a cell was empty.

    Where the reference is in another `unit`, such as arcsec, one of it counts as a um (1e-3 mm) in the attributes.
    """

    path: Path  #: path, sha256: the table's file; hash of it, its sidecar and its ball plate, for provenance
    sha256: str
    sidecar: Sidecar  #: what the sidecar says; `machine` and `reference` are short for its own
    row: IntArray  #: (N,) row as a spreadsheet shows it, the header being row 1
    #: (N,) s on the file's clock, strictly rising, never nan; without `has_time` the number of the row
    time_s: FloatArray
    #: session, visit, point: (N,) int or None if the column is absent; -1 where the cell is empty. Text ids are
    #: numbered in sorted order; `labels` has the texts.
    session: IntArray | None
    visit: IntArray | None
    point: IntArray | None
    scale_mm: FloatArray | None  #: (N, n) or None: gL_i, zero at machine zero
    joint_mm: FloatArray | None  #: (N, k) or None
    #: (N, 9) or None, in the order t1..t3, u1..u6. None only where the format allows them to be missing.
    frame_mm: FloatArray | None
    #: (N, n) or None: +1/-1, the direction in which link i last moved; from the columns, else from the scales
    #: (`compd.travel_direction`); nan where it is not known. With `machine: external` None; gauges and directions are
    #: quantities then.
    approach: FloatArray | None
    approach_measured: bool  #: whether there are `approach` columns
    #: full column name with unit -> (N,), in the column's unit: everything that is not named here
    quantities: Mapping[str, FloatArray]
    reference_axes: tuple[str, ...]
    #: (N, axes) or None: the tip on `reference_axes` (a subset of "x", "y", "z", in this order); for a ball plate the
    #: calibrated place of the row's ball, all three axes
    reference_mm: FloatArray | None
    reference_rotation_rad: FloatArray | None  #: (N, 3) or None: rotation vector of {P} in {M}
    reference_links: tuple[int, ...]
    reference_link_mm: FloatArray | None  #: (N, m) or None: change of the links `reference_links` (1-based numbers)
    #: (N,) or None: from the tip to the fixed end that `ball` names, or to the only one
    reference_distance_mm: FloatArray | None
    ball: IntArray | None  #: (N,) int or None, -1 where empty; text names of fixed ends are numbered in sorted order
    plate: BallPlate | None  #: the ball plate
    #: (N,) int or None: the fixed pin in which the tip was; -1 where empty, text numbered in sorted order
    pin: IntArray | None
    #: column of ids -> its texts, by number; columns whose ids are numbers are not among them
    labels: Mapping[str, tuple[str, ...]]
    #: model_mm, model_rotation_rad, model_link_mm: with `machine: external` the user's own model's prediction, column
    #: for column as the reference's
    model_mm: FloatArray | None
    model_rotation_rad: FloatArray | None
    model_link_mm: FloatArray | None
    excluded: BoolArray  #: (N,) bool, by the person; the reasons are in `sidecar.excluded`.
    left_out: Mapping[str, int]  #: reason -> rows of the file that are no row here (no time; empty row between others)
    columns: Mapping[str, FloatArray]  #: name -> (N,) every column as in the file, in the file's unit
    warnings: tuple[Problem, ...] = ()  #: what can be used but should be looked at
    #: whether the file has the time of each row; an external model's rows may be in order without it
    has_time: bool = True
    #: commanded_mm, commanded_rotation_rad: (N, 3) or None: the pose that the controller of a machine without scales
    #: was told; nan along an axis that has no column
    commanded_mm: FloatArray | None = None
    commanded_rotation_rad: FloatArray | None = None
    #: the file's first time, of a block or of chosen rows too; effects and descriptions count from it
    begin_s: float = 0.0
    #: data that are wrong or look so. Cells that these take as empty are so in `quantities`, not in `columns`.
    faults: tuple[DataFault, ...] = ()
    #: (N, 3) or None: where the row's reflector is, from the tip along the axes of {P}; nan where the cell is empty;
    #: None where the tip itself was measured
    target_P_mm: FloatArray | None = None
    #: where these rows were drawn from a longer recording, what is known of all of it; else None
    sample: RecordingSample | None = None

    @property
    def machine(self) -> str:
        """Name of the machine configuration, or "external"."""
        return self.sidecar.machine

    @property
    def reference(self) -> Reference | None:
        """The reference; None for gauges alone."""
        return self.sidecar.reference

    @property
    def unit(self) -> str:
        """Display unit of the reference and its errors: "um", or that of the sidecar."""
        return self.sidecar.unit

    @property
    def rows(self) -> int:
        """N."""
        return len(self.time_s)

    @property
    def elapsed_s(self) -> FloatArray:
        """(N,) time since the file's first row, s: what effects take, so that no result depends on a clock's origin."""
        return self.time_s - self.begin_s

    @cached_property
    def unused(self) -> BoolArray:
        """(N,) rows that do not count, by a person or because their data are wrong."""
        faulty = [row for fault in self.faults if fault.consequence == "rows left out" for row in fault.rows]
        return self.excluded | np.isin(self.row, faulty)

    def select(self, index: IntArray | slice) -> Recording:
        """The rows of this index (R,), in its order; of a slice without a copy."""
        chosen: dict[str, Any] = {}
        for column in fields(self):
            value = getattr(self, column.name)
            if isinstance(value, np.ndarray):
                chosen[column.name] = value[index]
            elif column.name in ("quantities", "columns"):
                chosen[column.name] = {name: values[index] for name, values in value.items()}
        return replace(self, **chosen)

    @property
    def gauge_columns(self) -> tuple[str, ...]:
        """Names of the columns behind scale_mm, joint_mm and frame_mm; without scales those of the commanded pose."""
        scales = 0 if self.scale_mm is None else self.scale_mm.shape[1]
        joints = 0 if self.joint_mm is None else self.joint_mm.shape[1]
        commanded = () if scales else (*COMMANDED_COLUMNS, *COMMANDED_ATTITUDE_COLUMNS)
        return (
            *(name for name in commanded if name in self.columns),
            *scale_columns(scales),
            *joint_columns(joints),
            *frame_columns(0 if self.frame_mm is None else self.frame_mm.shape[1]),
        )

    @property
    def motion_mm(self) -> FloatArray | None:
        """(N, k) what tells where the machine is: the scales; without them the commanded pose, a urad as a um."""
        if self.scale_mm is not None or self.commanded_mm is None:
            return self.scale_mm
        parts = [self.commanded_mm[:, ~np.isnan(self.commanded_mm).all(axis=0)]]
        if self.commanded_rotation_rad is not None:
            parts.append(self.commanded_rotation_rad * MM_PER_RAD)
        return np.concatenate(parts, axis=1)

    @property
    def reference_columns(self) -> tuple[str, ...]:
        """Names of the columns that hold the reference (`ball` for a ball plate, `pin` for a fixed pin)."""
        own = ("ball", "pin", "reflector")
        return tuple(name for name in self.columns if name.startswith("reference_") or name in own)

    @property
    def fixed_end(self) -> IntArray | None:
        """(N,) number of the fixed ball or pin of unknown place, -1 where empty; None for other references."""
        if self.reference is None or not self.reference.of_fixed_places:
            return None
        if self.reference.quantity == "fixed_point":
            return self.pin
        # without a column there is one fixed end
        return np.zeros(self.rows, dtype=np.int64) if self.ball is None else self.ball

    def end_name(self, number: int) -> str:
        """The fixed ball or pin of this number as the file names it: "pin 2", "ball post"."""
        kind = "pin" if self.pin is not None else "ball"
        return f"{kind} {self.labels[kind][number] if kind in self.labels else number}"

    @staticmethod
    def visit_in_file(visit: IntArray) -> IntArray:
        """Numbers of visits as the file has them, where they may come back; -1 for none."""
        return file_numbers(visit)

    def point_name(self, number: int) -> str:
        """The id of this point as the file has it."""
        return self.labels["point"][number] if "point" in self.labels else str(number)

    def with_texts(self, columns: Mapping[str, FloatArray]) -> dict[str, FloatArray | TextArray]:
        """Columns with the ids as the file has them: texts where these are texts, "" for an empty cell."""
        return {name: id_texts(v, self.labels[name]) if name in self.labels else v for name, v in columns.items()}

    @property
    def model_columns(self) -> tuple[str, ...]:
        """Names of the columns that hold the user's own model's prediction."""
        return tuple(name for name in self.columns if name.startswith("model_"))

    @property
    def reference_sigma_mm(self) -> FloatArray:
        """(axes or links,) standard uncertainty of the reference; nan where it is not known."""
        of_distance = self.reference_distance_mm is not None
        count = 1 if of_distance else len(self.reference_axes) or len(self.reference_links)
        sigma = self.reference.standard_uncertainty if self.reference else (np.nan,)
        return np.broadcast_to(np.array(sigma) / UM_PER_MM, (count,)).astype(np.float64)

    def exclusions_by_position(self) -> dict[int, str]:
        """Spreadsheet row -> reason, in the row numbers of a file with this recording's N rows alone."""
        return {int(i) + 2: self.sidecar.excluded[int(self.row[i])] for i in np.flatnonzero(self.excluded)}

    def usable(self, needed: Iterable[str]) -> UsableRows:
        """Rows without an exclusion and with a value in every column of `needed` (full names).

        Raises KeyError for a column that the recording does not have.
        """
        lacking = {"excluded by a person": self.excluded}
        for fault in self.faults:
            if fault.consequence == "rows left out":
                lacking[fault.reason] = lacking.get(fault.reason, False) | np.isin(self.row, fault.rows)
        lacking |= {f"{name} is empty": np.isnan(self.columns[name]) for name in needed}
        usable = UsableRows(np.ones(self.rows, dtype=bool), {}, np.full(self.rows, "", dtype=object))
        for reason, rows in lacking.items():
            usable = usable.without(np.asarray(rows), reason)
        return usable

    @cached_property
    def fold(self) -> IntArray:
        """(N,) groups that cross-validation leaves out as a whole: the session, else eight blocks of time.

        Blocks hold equally many rows as nearly as whole visits allow. Rows with an empty session are -1.
        """
        if self.session is not None:
            return self.session
        return self.first_of_visit(np.arange(self.rows, dtype=np.int64) * BLOCKS // max(self.rows, 1))

    def first_of_visit(self, label: IntArray) -> IntArray:
        """(N,) the label of each row, of a row in a visit that of the visit's first row: repeats stay together."""
        if self.visit is None:
            return label
        _, first_row, number = np.unique(self.visit, return_index=True, return_inverse=True)
        return np.where(self.visit >= 0, label[first_row][number], label).astype(np.int64)
