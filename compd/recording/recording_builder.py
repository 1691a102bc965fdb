"""Makes the Recording of a table file's rows, or of rows drawn from it, with the same checks."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.columns import (
    ATTITUDE_COLUMNS,
    ATTITUDES,
    AXES,
    COMMANDED_ATTITUDE_COLUMNS,
    COMMANDED_COLUMNS,
    DISTANCE_COLUMN,
    approach_columns,
    correct_names,
    frame_columns,
    joint_columns,
    scale_columns,
)
from compd.configuration import Configuration
from compd.errors import Problem, RecordingError
from compd.recording.ball_plate import check_balls, read_plate
from compd.recording.checks import (
    check_joint_unit,
    check_time,
    check_usable_rows,
    check_values,
)
from compd.recording.layout import Layout, machine_problems, read_layout
from compd.recording.quantity_faults import hanging_reference, quantity_faults, without_wild
from compd.recording.quaternion import with_rotation_vectors
from compd.recording.recording import Recording
from compd.recording.reference_faults import reference_faults
from compd.recording.sample import DrawnRows
from compd.recording.sidecar import Sidecar, read_sidecar
from compd.recording.visits import pose_mm, unique_visits
from compd.statistics import doubled_rows
from compd.tables import FIRST_ROW, ProblemList, Table, rows_text
from compd.travel_direction import row_directions
from compd.units import UM_PER_MM

COLUMN = "reflector"


def check_reflectors(table: Table, places_mm: Mapping[str, tuple[float, float, float]], problems: ProblemList) -> None:
    """Add a problem for every name in the column that the sidecar gives no place. The layout reports a missing column.

    places_mm : by name, from the tip along the axes of {P}.
    """
    if COLUMN not in table.columns:
        return
    if unknown := sorted(set(_names(table)) - {"", *places_mm}):
        problems.add(
            "",
            f"{COLUMN}: the sidecar gives no place of it",
            ", ".join(unknown[:5]),
            ", ".join(places_mm),
            "mend the name, or add its place to `reference.reflectors`",
        )


def reflector_places_mm(table: Table, places_mm: Mapping[str, tuple[float, float, float]]) -> FloatArray:
    """(N, 3) place of each row's reflector, from the tip along the axes of {P}; nan where the cell is empty.

    places_mm : as of `check_reflectors`, which the table has passed.
    """
    unknown = (np.nan, np.nan, np.nan)
    return np.array([places_mm.get(name, unknown) for name in _names(table)], dtype=np.float64).reshape(-1, 3)


def _names(table: Table) -> list[str]:
    """The reflector of each row as the sidecar names it, "" for an empty cell."""
    labels = table.labels.get(COLUMN)
    ids = [None if np.isnan(value) else int(value) for value in table.columns[COLUMN]]
    return ["" if i is None else labels[i] if labels else str(i) for i in ids]


NO_TIME, DOUBLED = "time_s is empty", "each row was written twice"


def kept_rows(columns: Mapping[str, FloatArray]) -> tuple[IntArray, dict[str, int]]:
    """The rows of a table in the order of time; and reason -> number of the rows that are left out.

    columns : (N,) by name, `time_s` among them. A row without a time is no row. Where every row was written twice, the
    second of each two is none; where a column `point` tells rows at rest from those of motions, each kind by itself.
    """
    timed = ~np.isnan(columns["time_s"])
    kept = np.argsort(columns["time_s"], kind="stable")[: int(timed.sum())]
    others = [column[kept] for name, column in columns.items() if name != "time_s"]
    values = np.column_stack([np.zeros((len(kept), 0)), *others])
    at_rest = np.isfinite(columns["point"][kept]) if "point" in columns else np.ones(len(kept), dtype=bool)
    doubled = np.zeros(len(kept), dtype=bool)
    for kind in (at_rest, ~at_rest):
        doubled[kind] = doubled_rows(values[kind])
    return kept[~doubled], {NO_TIME: int((~timed).sum()), DOUBLED: int(doubled.sum())}


# Decimals (mm) of comparators converted from um: a picometre, far below any gauge, so that a reading written in
# decimals comes back as the gauge's number.
_PICOMETRES_PER_MM = 1e9
_HASHED_BYTES = 1 << 20


class RecordingBuilder:
    """Makes the Recording of one file."""

    def __init__(self, path: Path, configuration: Configuration | None, needs_reference: bool) -> None:
        """Read the sidecar; `build` reports its faults.

        path : the table's file.  configuration, needs_reference : as in `read_recording`.
        """
        self._path = path
        self._configuration = configuration
        self._problems: list[Problem] = []
        self._sidecar = sidecar = read_sidecar(path.with_suffix(".yaml"), self._problems)
        self._reference_valid = sidecar is not None and (sidecar.reference is not None or not self._problems)
        no_reference = sidecar is not None and sidecar.reference is None and self._reference_valid
        if sidecar is not None and no_reference and (needs_reference or sidecar.external):
            self._problems.append(_no_reference(sidecar))
        #: columns of the table that may hold text
        self.id_columns = ("point", "pin", "reflector", *["ball"] * _names_fixed_ends(sidecar))
        balls = sidecar.reference.balls if sidecar and sidecar.reference else None
        self._plate = None if balls is None else read_plate(balls, self._problems)

    def build(self, table: Table | None, table_problems: ProblemList, drawn: DrawnRows | None = None) -> Recording:
        """The Recording of a table's rows.

        table : None if the file has none.  table_problems : what was wrong with it as it was read; what else is
        wrong is added.  drawn : of a sample, of which `table` has the rows with those around them.

        Raises RecordingError with every problem of the rows, the sidecar and the recording as a whole.
        """
        sidecar, problems = self._sidecar, self._problems
        if table is None:
            raise RecordingError([*problems, *table_problems.problems])
        table = correct_names(table, table_problems)
        table = with_rotation_vectors(table, table_problems)
        has_time = "time_s" in table.letters or sidecar is None
        if not has_time:
            table = _with_row_numbers(table, drawn)
        layout = read_layout(list(table.letters), sidecar, self._reference_valid, table_problems)
        if "time_s" in table.columns:
            check_time(table, table_problems)
        check_values(table, table_problems)
        excluded = self._excluded(table, table_problems, drawn)
        self._check_whole(table, layout, excluded, table_problems)
        if self._plate is not None and "ball" in table.columns:
            check_balls(table, self._plate, table_problems)
        if sidecar is not None and sidecar.reference is not None and sidecar.reference.reflectors is not None:
            check_reflectors(table, sidecar.reference.reflectors, table_problems)
        if self._configuration is not None and sidecar is not None and sidecar.machine:
            counts = (layout.scales, layout.joints, layout.frame)
            quantity = sidecar.reference.quantity if sidecar.reference else None
            where, commanded = str(sidecar.path), bool(layout.commanded)
            problems += machine_problems(
                sidecar.machine, counts, quantity, self._configuration, where, commanded=commanded
            )
        problems += table_problems.problems
        if problems or sidecar is None:
            raise RecordingError(problems)
        recording = self._recording(table, sidecar, layout, excluded, tuple(table_problems.warnings), drawn)
        return recording if has_time else _without_time(recording)

    def _check_whole(self, table: Table, layout: Layout, excluded: BoolArray, problems: ProblemList) -> None:
        """The checks that only all rows together allow."""
        needed = _needed_columns(layout, self._sidecar, table.letters)
        check_joint_unit(table, problems)
        if all(name in table.columns for name in needed):
            check_usable_rows(table, excluded, needed, problems)

    def _excluded(self, table: Table, problems: ProblemList, drawn: DrawnRows | None) -> BoolArray:
        """(N,) rows that the person excluded; a row that the file does not have is a problem."""
        sidecar = self._sidecar
        numbers = np.array(sorted(sidecar.excluded), dtype=np.int64) if sidecar else np.array([], dtype=np.int64)
        last_row = drawn.last_row if drawn else max([FIRST_ROW - 1, *table.row[-1:].tolist()])
        absent = numbers[numbers > last_row if drawn else ~np.isin(numbers, table.row) & (numbers >= FIRST_ROW)]
        if len(absent) and sidecar is not None:
            problems.problems.append(
                Problem(
                    f"{sidecar.path} excluded_rows",
                    f"{rows_text(absent.tolist())} of the file: no such row",
                    allowed=f"rows {FIRST_ROW} to {last_row}" if last_row >= FIRST_ROW else "",
                    next_step="count as the spreadsheet does: the header is row 1",
                )
            )
        return np.isin(table.row, numbers)

    def _recording(
        self,
        table: Table,
        sidecar: Sidecar,
        layout: Layout,
        excluded: BoolArray,
        warnings: tuple[Problem, ...],
        drawn: DrawnRows | None,
    ) -> Recording:
        """The rows in the order of time; those that are left out are counted."""
        kept, left_out = kept_rows(table.columns)
        columns = {name: values[kept] for name, values in table.columns.items()}
        left_out["empty row"] = 0 if drawn else _blank_rows(table)

        def stack(names: Iterable[str]) -> FloatArray | None:
            present = [columns[name] for name in names if name in columns]
            return np.column_stack(present) if present else None

        def in_mm(kind: str, places: Iterable[str]) -> FloatArray | None:
            """Reference or model; one unit of an angle counts as a micrometre."""
            values = stack(f"{kind}_{place}_{layout.ending}" for place in places)
            return values if values is None or layout.ending == "mm" else values / UM_PER_MM

        def ids(name: str) -> IntArray | None:
            return np.where(np.isnan(columns[name]), -1, columns[name]).astype(np.int64) if name in columns else None

        session, ball = ids("session"), ids("ball")
        reflectors = None if sidecar.reference is None else sidecar.reference.reflectors
        places_mm = None if reflectors is None else reflector_places_mm(table, reflectors)[kept]
        scale_mm = stack(scale_columns(layout.scales))
        approach = stack(approach_columns(layout.scales)) if layout.approach else None
        if approach is None and scale_mm is not None:
            known = None if drawn is None else drawn.approach
            approach = row_directions(scale_mm, session) if known is None else known[kept]
        joint_um = stack(joint_columns(layout.joints))
        frame_um = stack(frame_columns(layout.frame))
        position = in_mm("reference", AXES)
        links = [f"link_{i}" for i in layout.links]
        if self._plate is not None and ball is not None:
            position = self._plate.positions_of_mm(ball)
        model_mm, model_link_mm = in_mm("model", AXES), in_mm("model", links)
        commanded_mm = np.stack([columns.get(name, np.full(len(kept), np.nan)) for name in COMMANDED_COLUMNS], axis=1)
        distance_mm = columns.get(DISTANCE_COLUMN)
        commanded_rad = stack(COMMANDED_ATTITUDE_COLUMNS) if layout.commanded else None
        model_rad = stack(f"model_{axis}_rad" for axis in ATTITUDES)
        poses_mm = (
            scale_mm,
            pose_mm(commanded_mm if layout.commanded else None, commanded_rad),
            pose_mm(model_mm, model_rad),
            model_link_mm,
        )
        place_mm = next((place for place in poses_mm if place is not None), None)
        visit = ids("visit")
        if visit is not None:
            visit, again = unique_visits(visit, session, place_mm, places_mm)
            warnings = (*warnings, self._visits_again(again)) if again and not drawn else warnings
        covariates, row = {name: columns[name] for name in layout.covariates}, table.row[kept]
        same_frame = sidecar.reference is not None and sidecar.reference.frame == "machine"
        sample = None if drawn is None else drawn.sample
        counting = ~excluded[kept] & (sample is None or np.isin(row, sample.row))
        counted = {name: values[counting] for name, values in columns.items()}
        of_reference = reference_faults(counted, row[counting], same_frame)
        hanging = hanging_reference(counted, row[counting], of_reference)
        faults = [
            *of_reference,
            *hanging,
            *quantity_faults({name: counted[name] for name in covariates}, row[counting]),
        ]
        faults = [left for fault in faults if (left := fault.without(sidecar.trusted)) is not None]
        if sidecar.reference is not None and sidecar.reference.radius_mm is not None:
            distance_mm = np.full(len(kept), sidecar.reference.radius_mm)
        return Recording(
            path=table.path,
            sha256=self._sha256,
            sidecar=sidecar,
            row=row,
            time_s=columns["time_s"],
            session=session,
            visit=visit,
            point=ids("point"),
            scale_mm=scale_mm,
            joint_mm=_to_mm(joint_um),
            frame_mm=_to_mm(frame_um),
            commanded_mm=commanded_mm if layout.commanded else None,
            commanded_rotation_rad=commanded_rad,
            approach=approach,
            approach_measured=layout.approach,
            quantities={name: without_wild(name, values, row, faults) for name, values in covariates.items()},
            reference_axes=layout.axes,
            reference_mm=position,
            reference_rotation_rad=stack(ATTITUDE_COLUMNS),
            reference_links=layout.links,
            reference_link_mm=in_mm("reference", links),
            reference_distance_mm=distance_mm,
            ball=ball,
            plate=self._plate,
            pin=ids("pin"),
            labels=table.labels,
            model_mm=model_mm,
            model_rotation_rad=model_rad,
            model_link_mm=model_link_mm,
            excluded=excluded[kept],
            left_out={reason: count for reason, count in left_out.items() if count},
            columns=columns,
            warnings=warnings,
            begin_s=float(columns["time_s"][0]) if len(kept) else 0.0,
            faults=tuple(faults),
            target_P_mm=places_mm,
            sample=sample,
        )

    def _visits_again(self, again: int) -> Problem:
        return Problem(
            f"{self._path} column `visit`",
            "numbers come back for rows in another session, at another place or after other visits",
            value=f"{again} numbers",
            allowed="a visit has rows that follow each other in one session at one place; a return is another",
            next_step="number the visits on from session to session, if all is to be unique",
        )

    @cached_property
    def _sha256(self) -> str:
        """Hash of the table's file, its sidecar and its ball plate, in hexadecimal digits."""
        digest = hashlib.sha256()
        others = (self._path.with_suffix(".yaml"), *([] if self._plate is None else [self._plate.path]))
        for i, path in enumerate((self._path, *others)):
            digest.update(b"\0" * (i > 0))
            with path.open("rb") as file:
                while piece := file.read(_HASHED_BYTES):
                    digest.update(piece)
        return digest.hexdigest()


def _no_reference(sidecar: Sidecar) -> Problem:
    return Problem(
        str(sidecar.path),
        "names no reference",
        allowed="`reference:` with its `quantity:`",
        next_step="write reference: {quantity: tool_position, frame: machine}"
        if sidecar.external
        else "put an instrument's export beside the gauges with `compd recording join`",
    )


def _blank_rows(table: Table) -> int:
    """Empty rows between those of the table, and before the first."""
    return int(table.row[-1]) - FIRST_ROW + 1 - len(table.row) if len(table.row) else 0


def _with_row_numbers(table: Table, drawn: DrawnRows | None) -> Table:
    """The table with the number of each row, from 0, in the place of its time: rows count as taken in order."""
    numbers = np.arange(len(table.row)) if drawn is None else table.row - FIRST_ROW
    columns = {**table.columns, "time_s": numbers.astype(np.float64)}
    return replace(table, letters={**table.letters, "time_s": ""}, columns=columns)


def _without_time(recording: Recording) -> Recording:
    """The recording of a table `_with_row_numbers`: the column is not in the file, and its numbers are no seconds."""
    columns = {name: values for name, values in recording.columns.items() if name != "time_s"}
    return replace(recording, columns=columns, has_time=False)


def _names_fixed_ends(sidecar: Sidecar | None) -> bool:
    """Whether the column `ball` names the fixed ends of distances, and no ball of a plate."""
    return sidecar is not None and sidecar.reference is not None and sidecar.reference.quantity == "distance"


def _needed_columns(layout: Layout, sidecar: Sidecar | None, names: Collection[str]) -> list[str]:
    """Columns that a usable row needs: time, and the reference with the columns that predict it."""
    reference = sidecar.reference if sidecar else None
    reference_columns = [f"reference_{name}" for name in layout.reference]
    if reference is not None and reference.quantity == "ball_plate":
        reference_columns = ["ball"]
    if reference is not None and reference.reflectors is not None:
        reference_columns.append("reflector")
    if reference is not None and reference.of_fixed_places:
        own = ("pin",) if reference.quantity == "fixed_point" else (DISTANCE_COLUMN, "ball")
        reference_columns = [name for name in own if name in names]
    predictors = [*scale_columns(layout.scales), *layout.commanded]
    if sidecar is not None and sidecar.external:
        predictors = [f"model_{name}" for name in layout.reference]
    return ["time_s", *predictors, *(reference_columns if reference is not None else ())]


def _to_mm(value_um: FloatArray | None) -> FloatArray | None:
    """The values in mm, rounded to a picometre; None stays None."""
    return None if value_um is None else np.rint(value_um * (_PICOMETRES_PER_MM / UM_PER_MM)) / _PICOMETRES_PER_MM
