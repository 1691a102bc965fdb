"""Reading a recording: NAME.csv and NAME.yaml as a Recording, or every problem in them at once."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.configuration import Configuration
from compd.errors import Problem, RecordingError
from compd.recording.ball_plate import BallPlate, check_balls, read_plate
from compd.recording.checks import check_rows, check_values
from compd.recording.columns import (
    ATTITUDE_COLUMNS,
    ATTITUDES,
    AXES,
    DISTANCE_COLUMN,
    FRAME_COLUMNS,
    approach_columns,
    correct_names,
    is_header,
    joint_columns,
    scale_columns,
)
from compd.recording.csv_table import CsvTable, read_table
from compd.recording.layout import Layout, machine_problems, read_layout
from compd.recording.problem_list import ProblemList, rows_text
from compd.recording.recording import Recording
from compd.recording.sidecar import Sidecar, read_sidecar
from compd.travel_direction import row_directions
from compd.units import UM_PER_MM

# Comparators are converted from um to mm and rounded to a picometre, far below any gauge, so that a reading
# that was written in decimals comes back as the same number that the gauge delivered.
_PICOMETRES_PER_MM = 1e9


def read_recording(path: Path, configuration: Configuration | None = None, needs_reference: bool = True) -> Recording:
    """Read and check the recording `path` (NAME.csv) with its sidecar NAME.yaml beside it.

    configuration : the machine that it must fit; without one, only the files are compared with each other.
    needs_reference : False admits gauges alone (no `reference:` in the sidecar), for `compd join`.

    Raises RecordingError with every problem: file, row, column, value, what is allowed, next step.
    """
    if path.suffix in (".yaml", ".yml"):
        path = path.with_suffix(".csv")
    sidecar_path = path.with_suffix(".yaml")
    problems: list[Problem] = []
    sidecar = read_sidecar(sidecar_path, problems)
    reference_valid = sidecar is not None and (sidecar.reference is not None or not problems)
    if sidecar is not None and sidecar.reference is None and reference_valid and (needs_reference or sidecar.external):
        problems.append(
            Problem(
                where=str(sidecar_path),
                what="names no reference",
                allowed="`reference:` with its `quantity:`",
                next_step="write reference: {quantity: tool_position, frame: machine}"
                if sidecar.external
                else "put an instrument's export beside the gauges with `compd join`",
            )
        )
    table_problems = ProblemList(path)
    named = ("point", "pin", "ball") if _names_fixed_ends(sidecar) else ("point", "pin")
    table = read_table(path, table_problems, is_header, named)
    balls = sidecar.reference.balls if sidecar and sidecar.reference else None
    plate = None if balls is None else read_plate(balls, problems)
    if table is None:
        raise RecordingError([*problems, *table_problems.problems])
    table = correct_names(table, table_problems)
    has_time = "time_s" in table.letters or sidecar is None or not sidecar.external
    if not has_time:
        table = _with_row_numbers(table)
    layout = read_layout(list(table.letters), sidecar, reference_valid, table_problems)
    check_values(table, table_problems)
    excluded = _excluded(table, sidecar, table_problems)
    needed = _needed_columns(layout, sidecar, table.letters)
    if all(name in table.columns for name in needed):
        check_rows(table, excluded, needed, table_problems)
    if plate is not None and "ball" in table.columns:
        check_balls(table, plate, table_problems)
    if configuration is not None and sidecar is not None and sidecar.machine:
        counts = (layout.scales, layout.joints)
        problems += machine_problems(sidecar.machine, counts, configuration, str(sidecar_path))
    problems += table_problems.problems
    if problems or sidecar is None:
        raise RecordingError(problems)
    recording = _build(table, sidecar, layout, excluded, plate, tuple(table_problems.warnings))
    return recording if has_time else _without_time(recording)


def check_against(recording: Recording, configuration: Configuration) -> None:
    """Raise RecordingError where the recording is of another machine: its name, or its number of gauges."""
    scales = 0 if recording.scale_mm is None else recording.scale_mm.shape[1]
    joints = 0 if recording.joint_mm is None else recording.joint_mm.shape[1]
    if problems := machine_problems(recording.machine, (scales, joints), configuration, str(recording.sidecar.path)):
        raise RecordingError(problems)


def _with_row_numbers(table: CsvTable) -> CsvTable:
    """The table with the number of each row, from 0, in the place of its time: the rows count as taken in order."""
    numbers = np.arange(len(table.row), dtype=np.float64)
    return replace(table, letters={**table.letters, "time_s": ""}, columns={**table.columns, "time_s": numbers})


def _without_time(recording: Recording) -> Recording:
    """The recording of a table `_with_row_numbers`: the column is not in the file, and its numbers are no seconds."""
    columns = {name: values for name, values in recording.columns.items() if name != "time_s"}
    return replace(recording, columns=columns, has_time=False)


def _names_fixed_ends(sidecar: Sidecar | None) -> bool:
    """Whether the column `ball` names the fixed ends of distances, and no ball of a plate."""
    return sidecar is not None and sidecar.reference is not None and sidecar.reference.quantity == "distance"


def _needed_columns(layout: Layout, sidecar: Sidecar | None, names: Collection[str]) -> list[str]:
    """Columns without which a row is of no use: time, and the reference with what predicts it."""
    reference = sidecar.reference if sidecar else None
    reference_columns = [f"reference_{name}" for name in layout.reference]
    if reference is not None and reference.quantity == "ball_plate":
        reference_columns = ["ball"]
    if reference is not None and reference.of_fixed_places:
        own = ("pin",) if reference.quantity == "fixed_point" else (DISTANCE_COLUMN, "ball")
        reference_columns = [name for name in own if name in names]
    predictors = list(scale_columns(layout.scales))
    if sidecar is not None and sidecar.external:
        predictors = [f"model_{name}" for name in layout.reference]
    return ["time_s", *predictors, *(reference_columns if reference is not None else ())]


def _excluded(table: CsvTable, sidecar: Sidecar | None, problems: ProblemList) -> BoolArray:
    """(N,) rows that the person excluded; a row that the file does not have is a problem."""
    numbers = np.array(sorted(sidecar.excluded), dtype=np.int64) if sidecar else np.array([], dtype=np.int64)
    absent = numbers[~np.isin(numbers, table.row)]
    if len(absent) and sidecar is not None:
        problems.problems.append(
            Problem(
                where=f"{sidecar.path} excluded_rows",
                what=f"{rows_text(absent.tolist())} of the file: no such row",
                allowed=f"rows {table.row[0]} to {table.row[-1]}" if len(table.row) else "",
                next_step="count as the spreadsheet does: the header is row 1",
            )
        )
    return np.isin(table.row, numbers)


def _build(
    table: CsvTable,
    sidecar: Sidecar,
    layout: Layout,
    excluded: BoolArray,
    plate: BallPlate | None,
    warnings: tuple[Problem, ...],
) -> Recording:
    """The Recording of files without problems, in the order of time; rows without a time are left out and counted."""
    timed = ~np.isnan(table.columns["time_s"])
    kept = np.argsort(table.columns["time_s"], kind="stable")[: int(timed.sum())]
    columns = {name: values[kept] for name, values in table.columns.items()}
    left_out = {"time_s is empty": int((~timed).sum()), "empty row": table.blank_rows}

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
    scale_mm = stack(scale_columns(layout.scales))
    approach = stack(approach_columns(layout.scales)) if layout.approach else None
    if approach is None and scale_mm is not None:
        approach = row_directions(scale_mm, session)
    joint_um = stack(joint_columns(layout.joints))
    frame_um = stack(FRAME_COLUMNS) if layout.frame else None
    position = in_mm("reference", AXES)
    links = [f"link_{i}" for i in layout.links]
    if plate is not None and ball is not None:
        position = plate.positions_of_mm(ball)
    distance_mm = columns.get(DISTANCE_COLUMN)
    if sidecar.reference is not None and sidecar.reference.radius_mm is not None:
        distance_mm = np.full(len(kept), sidecar.reference.radius_mm)
    return Recording(
        path=table.path,
        sha256=_sha256(table.content, sidecar, plate),
        sidecar=sidecar,
        row=table.row[kept],
        time_s=columns["time_s"],
        session=session,
        visit=ids("visit"),
        point=ids("point"),
        scale_mm=scale_mm,
        joint_mm=_to_mm(joint_um),
        frame_mm=_to_mm(frame_um),
        approach=approach,
        approach_measured=layout.approach,
        quantities={name: columns[name] for name in layout.covariates},
        reference_axes=layout.axes,
        reference_mm=position,
        reference_rotation_rad=stack(ATTITUDE_COLUMNS),
        reference_links=layout.links,
        reference_link_mm=in_mm("reference", links),
        reference_distance_mm=distance_mm,
        ball=ball,
        plate=plate,
        pin=ids("pin"),
        end_names=table.labels.get("pin" if "pin" in columns else "ball", ()),
        model_mm=in_mm("model", AXES),
        model_rotation_rad=stack(f"model_{axis}_rad" for axis in ATTITUDES),
        model_link_mm=in_mm("model", links),
        excluded=excluded[kept],
        left_out={reason: count for reason, count in left_out.items() if count},
        columns=columns,
        warnings=warnings,
        point_labels=table.labels.get("point", ()),
    )


def _to_mm(value_um: FloatArray | None) -> FloatArray | None:
    """The values in mm, rounded to a picometre; None stays None."""
    return None if value_um is None else np.rint(value_um * (_PICOMETRES_PER_MM / UM_PER_MM)) / _PICOMETRES_PER_MM


def _sha256(content: bytes, sidecar: Sidecar, plate: BallPlate | None) -> str:
    """Hash of the CSV file, its sidecar and its ball plate, in hexadecimal digits."""
    digest = hashlib.sha256(content)
    digest.update(b"\0" + sidecar.path.read_bytes())
    if plate is not None:
        digest.update(b"\0" + plate.content)
    return digest.hexdigest()
