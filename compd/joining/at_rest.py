"""Joining a recording of gauges with points that an instrument measured at rest, by order, name or distance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from compd.arrays import FloatArray, IntArray, TextArray
from compd.configuration import Configuration
from compd.errors import Problem, RecordingError
from compd.instruments import LENGTH_AXES, POSITION_AXES, InstrumentExport
from compd.joining.assignment import Assignment, NoAssignment, repeat_distance_mm
from compd.joining.by_distance import assign_by_distance
from compd.joining.by_name import assign_by_name, check_names
from compd.joining.by_order import assign_by_order
from compd.joining.by_time import Instrument
from compd.joining.distances import MAX_RMS_MM, distances_rms_mm, lay_over
from compd.joining.dwells import Dwell, dwell_columns, find_dwells
from compd.joining.expected_places import expected_places_mm
from compd.joining.joined_rows import joined_columns, joined_sidecar
from compd.joining.misplaced_names import lines_text, listed, name_problems
from compd.joining.monotone_match import CLEAR_MARGIN, match_in_order
from compd.joining.reflectors import SeenReflector, points_of, reflector_problems, seen_reflectors
from compd.plan_file import TIP_COLUMNS, WRITTEN_BY
from compd.recording import Recording
from compd.tables import ProblemList, read_table
from compd.units import UM_PER_MM


def read_plan_points(path: Path) -> FloatArray:
    """(K, 3) places of a plan's rows in {M}, mm. Raises RecordingError for an unreadable plan."""
    problems = ProblemList(path)
    table = read_table(path, problems, lambda cells: "time_s" in cells, ("purpose",))
    if table is None:
        raise RecordingError(problems.problems)
    missing = [name for name in TIP_COLUMNS if name not in table.columns]
    if missing:
        problems.refuse("", f"has no column {', '.join(missing)}", allowed=", ".join(TIP_COLUMNS), next_step=WRITTEN_BY)
    places_mm = np.column_stack([table.columns[name] for name in TIP_COLUMNS])
    if problems.problems or not len(places_mm) or not np.isfinite(places_mm).all():
        problems.refuse("", "has rows without a place for the tip", next_step=WRITTEN_BY)
    return places_mm


def dwell_of_plan_rows(expected_mm: FloatArray, plan_mm: FloatArray, path: Path) -> IntArray:
    """(K,) number of the dwell, from 0, of each row of a plan; -1 where ambiguous.

    expected_mm : (S, 3) places of the dwells in {M}, in the order of time. plan_mm : (K, 3) of the plan's rows, in the
        order of measuring; rows at one place, such as those with different loads, may share a dwell.
    A dwell may be MAX_RMS_MM from the plan's place, no more. Raises RecordingError if none is at any place.
    """
    residual_mm = np.linalg.norm(expected_mm[:, None, :] - plan_mm[None, :, :], axis=2)
    match = match_in_order(residual_mm, MAX_RMS_MM)
    clear = (match.dwell >= 0) & (match.margin >= CLEAR_MARGIN)
    if not clear.any():
        raise RecordingError.of(
            str(path),
            "the machine dwelled at no place of the plan, in its order",
            value=f"nearest {np.nanmin(residual_mm):.3g} mm" if np.isfinite(residual_mm).any() else "",
            allowed=f"{MAX_RMS_MM:g} mm",
            next_step="give the plan that was measured, or join --by order",
        )
    return np.where(clear, match.dwell, -1).astype(np.int64)


By = Literal["order", "name", "distance"]


@dataclass(frozen=True)
class RestJoin:
    """A recording of points at rest, each beside the gauges in its dwell; `write_recording` writes it."""

    columns: Mapping[str, FloatArray | TextArray]  #: columns, sidecar: of the recording
    sidecar: Mapping[str, Any]
    by: By  #: "order", "name" or "distance"
    dwells: tuple[Dwell, ...]  #: of the recording of gauges
    points: int  #: of the export
    joined: int  #: rows, one for each point with a dwell
    #: line, dwell_number: (G,) line of each point in the export, and the number of its dwell from 1; 0 for none
    line: IntArray
    dwell_number: IntArray
    #: (G,) how far each point is from its dwell once all are laid over the dwells; nan for none
    residual_mm: FloatArray
    first: tuple[int, Dwell]  #: first, last: (line of the export, dwell) of the first and the last pair
    last: tuple[int, Dwell]
    #: root mean square of what the distances between points differ by from those of the machine's kinematics
    rms_mm: float
    #: (shift in dwells, its rms in mm) of an assignment by order; None if there is no other
    next_best: tuple[int, float] | None = None
    #: reason -> points or dwells, in words, that are in no row
    left_out: Mapping[str, str] = field(default_factory=dict)
    of_lengths: bool = False  #: whether the points are lengths along a link


@dataclass(frozen=True)
class _Assigned:
    """dwell : (G,) of each point, -1 for none. visit : (G,) the same for repeats. The rest as in RestJoin."""

    dwell: IntArray
    visit: IntArray
    rms_mm: float
    next_best: tuple[int, float] | None
    left_out: dict[str, str]


def match_at_rest(
    recording: Recording,
    configuration: Configuration | None,
    export: InstrumentExport,
    instrument: Instrument,
    by: By,
    plan: Path | None = None,
) -> RestJoin:
    """One row for each point, with the gauges' readings in its dwell; nothing is written.

    Parameters
    ----------
    recording : of gauges alone. configuration : of its machine; None is refused.
    export : x, y, z of points, or lengths along `instrument.link`; times are not used.
    by : "order": the points were measured in the order of the dwells. "name": names are ids in `point`, or with `plan`
        the numbers of the plan's rows. "distance": neither is known, each place was visited once.
    plan : the plan that the machine has measured.

    Raises
    ------
    RecordingError
        Where the dwells and the points cannot be told to belong together.
    """
    if problems := _problems(recording, configuration, export, instrument, by):
        raise RecordingError(problems)
    assert configuration is not None
    dwells = find_dwells(recording)
    readings = dwell_columns(recording, [d.rows for d in dwells])
    expected_mm = expected_places_mm(configuration, readings, instrument.link)
    reachable = np.asarray(np.isfinite(expected_mm).all(axis=1))
    no_pose = int((~reachable).sum())
    if not reachable.any():
        raise RecordingError.of(str(recording.path), "the gauges give a pose in no dwell")
    kept = [dwell for dwell, known in zip(dwells, reachable, strict=True) if known]
    places_mm = expected_mm[reachable]
    measured_mm = export.values[:, : places_mm.shape[1]]
    reflectors = seen_reflectors(export, instrument.reflectors)
    target_mm, each = np.full(measured_mm.shape, np.nan), list[_Assigned]()
    for reflector in reflectors:
        at_mm = places_mm
        if reflector.place_P_mm is not None:
            at_mm = expected_places_mm(configuration, readings, None, reflector.place_P_mm)[reachable]
        assigned = _assigned(kept, at_mm, points_of(export, reflector.points), instrument, by, plan)
        target_mm[reflector.points] = at_mm[assigned.dwell]
        each.append(assigned)
    assigned = each[0] if len(each) == 1 else _of_all(reflectors, each, measured_mm, target_mm)
    if export.visit is not None:
        assigned = replace(assigned, visit=_told_apart(assigned.visit, export.visit))
    points = np.flatnonzero(assigned.dwell >= 0)
    columns = joined_columns(recording, kept, assigned.dwell, assigned.visit, places_mm, export, instrument)
    left_out = dict(assigned.left_out)
    if no_pose:
        left_out["dwells in which the gauges give no pose"] = str(no_pose)
    number_rows = len(columns["visit"])
    sidecar = joined_sidecar(
        recording, export, instrument, by, number_rows, len(export.line), assigned.rms_mm, assigned.next_best
    )
    pairs = [(int(export.line[j]), kept[assigned.dwell[j]]) for j in (points[0], points[-1])]
    dwell_number, residual_mm = np.zeros(len(export.line), dtype=np.int64), np.full(len(export.line), np.nan)
    dwell_number[points] = [kept[i].number for i in assigned.dwell[points]]
    at_mm = target_mm[points]
    laid_over_mm = lay_over(measured_mm[points], at_mm)(measured_mm[points])
    residual_mm[points] = np.linalg.norm(laid_over_mm - at_mm, axis=1)
    return RestJoin(
        columns,
        sidecar,
        by,
        dwells,
        len(export.line),
        number_rows,
        export.line,
        dwell_number,
        residual_mm,
        pairs[0],
        pairs[1],
        assigned.rms_mm,
        assigned.next_best,
        left_out,
        instrument.link is not None,
    )


def _problems(
    recording: Recording,
    configuration: Configuration | None,
    export: InstrumentExport,
    instrument: Instrument,
    by: By,
) -> list[Problem]:
    problems = reflector_problems(export, instrument.reflectors, at_rest=True)

    def add(where: Path, what: str, value: str = "", allowed: str = "", next_step: str = "") -> None:
        problems.append(Problem(str(where), what, value=value, allowed=allowed, next_step=next_step))

    if recording.reference is not None:
        what = "has a reference already"
        add(recording.sidecar.path, what, recording.reference.quantity, "", "join to a recording of gauges alone")
    if configuration is None or recording.motion_mm is None:
        what = "points at rest are joined by the distances that the machine's kinematics expects"
        add(
            recording.sidecar.path,
            what,
            recording.machine,
            "scales or a commanded pose, and the machine's configuration",
            "--machine",
        )
    if instrument.sigma_um is not None and not 0 < instrument.sigma_um < np.inf:
        what, next_step = "no standard uncertainty", "leave --sigma-um out where it is not known"
        add(export.path, what, str(instrument.sigma_um), "more than 0 um", next_step)
    if instrument.ball is not None or instrument.sigma_urad is not None:
        add(
            export.path,
            "distances and attitudes are joined by time",
            "",
            "--by time",
            "leave --ball and --sigma-urad out",
        )
    links = 0 if recording.scale_mm is None else recording.scale_mm.shape[1]
    if export.axes == LENGTH_AXES:
        if instrument.link is None or not 1 <= instrument.link <= links:
            what, next_step = "is a length, of no link of this machine", "say which link it measures with --link"
            add(export.path, what, str(instrument.link or ""), f"1 to {links}", next_step)
        if by != "order":
            add(export.path, "lengths are joined by time or by order", f"--by {by}", "--by order, --by time")
    elif instrument.link is not None:
        add(export.path, "is a position, not a link's length", ", ".join(export.axes), "", "leave --link out")
    elif export.axes[:3] != POSITION_AXES:
        what = "points at rest are joined by their distances, which need x, y and z"
        add(export.path, what, ", ".join(export.axes), "x, y, z", "join by time")
    if by == "name" and export.name is None:
        add(
            export.path, "has no names of points", "", "a column of names", "name it with --columns, or join --by order"
        )
    if len(export.line) == 0:
        add(export.path, "has no point")
    return problems


def _assigned(
    dwells: list[Dwell],
    places_mm: FloatArray,
    export: InstrumentExport,
    instrument: Instrument,
    by: By,
    plan: Path | None,
) -> _Assigned:
    """The assignment of one reflector's points. places_mm : (D, d) where it is expected in each dwell."""
    measured_mm = export.values[:, : places_mm.shape[1]]
    sigma_mm = np.nan if instrument.sigma_um is None else instrument.sigma_um / UM_PER_MM
    in_M = instrument.frame == "machine"
    if by == "name":
        return _by_name(dwells, places_mm, export, measured_mm, sigma_mm, plan, in_M)
    if by == "order":
        return _by_places(assign_by_order(places_mm, measured_mm, sigma_mm), dwells, export)
    return _by_places(assign_by_distance(places_mm, measured_mm, sigma_mm, in_M), dwells, export)


def _of_all(
    reflectors: Sequence[SeenReflector], each: Sequence[_Assigned], measured_mm: FloatArray, target_mm: FloatArray
) -> _Assigned:
    """The assignments of several reflectors as one. target_mm : (G, 3) where each point is expected."""
    dwell = np.full(len(measured_mm), -1, dtype=np.int64)
    visit, left_out = dwell.copy(), dict[str, str]()
    for k, (reflector, own) in enumerate(zip(reflectors, each, strict=True)):
        dwell[reflector.points] = own.dwell
        # repeats are of one reflector
        visit[reflector.points] = np.where(own.visit < 0, -1, own.visit * len(each) + k)
        left_out |= {f"reflector {reflector.name}: {reason}": which for reason, which in own.left_out.items()}
    joined = dwell >= 0
    next_best = [own.next_best for own in each if own.next_best is not None]
    rms_mm = distances_rms_mm(target_mm[joined], measured_mm[joined])
    return _Assigned(dwell, visit, rms_mm, min(next_best, key=lambda best: best[1], default=None), left_out)


def _told_apart(visit: IntArray, told: Sequence[str]) -> IntArray:
    """(G,) visits, of which the export tells some apart that one dwell holds; -1 for none."""
    numbers = np.unique(np.array(told), return_inverse=True)[1]
    return np.where(visit < 0, -1, visit * (int(numbers.max()) + 1) + numbers)


def _by_places(result: Assignment | NoAssignment, dwells: list[Dwell], export: InstrumentExport) -> _Assigned:
    """The assignment by places. Raises RecordingError if they are ambiguous."""
    if isinstance(result, NoAssignment):
        where = str(export.path)
        if result.point is not None and result.dwell is not None:
            dwell = dwells[min(result.dwell, len(dwells) - 1)]
            where += f":{export.line[result.point]}, beside {dwell}"
        raise RecordingError.of(
            where,
            result.why,
            value=result.value,
            allowed=result.allowed,
            next_step="check that both are of one measurement, their unit and the machine; delete points that were "
            "measured beside it; with names of points: --by name",
        )
    left_out = {}
    fits_none = np.flatnonzero((result.dwell < 0) & ~result.unclear)
    if len(fits_none):
        left_out[f"points of no dwell, none within {result.limit_mm:.2g} mm"] = lines_text(export, fits_none)
    if result.unclear.any():
        left_out["points that fit two dwells alike"] = lines_text(export, np.flatnonzero(result.unclear))
    without = np.setdiff1d(np.arange(len(dwells)), result.dwell)
    if len(without):
        left_out["dwells without a point"] = listed([str(dwells[i].number) for i in without])
    return _Assigned(result.dwell, result.dwell, result.rms_mm, result.next_best, left_out)


def _by_name(
    dwells: list[Dwell],
    places_mm: FloatArray,
    export: InstrumentExport,
    measured_mm: FloatArray,
    sigma_mm: float,
    plan: Path | None,
    in_M: bool,
) -> _Assigned:
    assert export.name is not None
    if plan is None:
        targets = np.arange(len(dwells))
        ids = [dwell.point for dwell in dwells]
    else:
        targets = dwell_of_plan_rows(places_mm, read_plan_points(plan), plan)
        ids = [str(row) if dwell >= 0 else "" for row, dwell in enumerate(targets.tolist(), start=1)]
        first_row = {dwell: row for row, dwell in reversed([*enumerate(targets.tolist(), start=1)])}
        dwells = [replace(dwell, point=str(first_row.get(k, ""))) for k, dwell in enumerate(dwells)]
    if not any(ids):
        raise RecordingError.of(
            str(export.path),
            "the recording has no ids of points that names could be",
            allowed="a column `point` in the recording, or the plan that was measured",
            next_step="give --plan PLAN.csv, or join --by order",
        )
    order = np.arange(len(export.name)) if export.time_s is None else np.argsort(export.time_s, kind="stable")
    sizes = [len(dwells[dwell].rows) if dwell >= 0 else 0 for dwell in targets]
    named = assign_by_name(ids, sizes, [export.name[j] for j in order])
    target_of = named.dwell[np.argsort(order)]
    dwell_of = np.where(target_of >= 0, targets[target_of], -1)
    left_out = {}
    if named.unknown:
        left_out["names that no dwell has"] = listed(named.unknown)
    if named.unclear:
        left_out["names of which it is not clear at which visit each point was measured"] = listed(named.unclear)
    if named.without:
        left_out["points of the recording without a name in the export"] = listed(named.without)
    if not (dwell_of >= 0).any():
        raise RecordingError.of(
            str(export.path),
            "no name is a point of the recording"
            if not named.unclear
            else "the places were visited several times, and the points do not stand in the order of measuring",
            value=listed(export.name),
            allowed=listed([own for own in dict.fromkeys(ids) if own]),
            next_step="name the points as the recording or the plan does, list them in the order of measuring or "
            "with times, or join --by order",
        )
    check = check_names(places_mm, measured_mm, dwell_of, repeat_distance_mm(sigma_mm), in_M)
    if check.why or len(check.wrong) or check.rms_mm > check.allowed_mm:
        raise RecordingError(name_problems(check, dwells, export, dwell_of))
    return _Assigned(dwell_of, target_of, check.rms_mm, None, left_out)
