"""Merging several recordings of one machine into one, in the order of measurement."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.columns import ID_COLUMNS
from compd.errors import Problem, RecordingError
from compd.recording.recording import Recording
from compd.recording.reference import sigma_key
from compd.recording.sidecar import sidecar_contents
from compd.recording.writer import write_recording

# Assumed interval of two recordings whose sidecars lack the start.
ASSUMED_GAP_S = 3600.0
# Ids that every recording counts for itself; a ball's number means the same in every recording.
_RENUMBERED = tuple(name for name in ID_COLUMNS if name != "ball")


class MergeResult(NamedTuple):
    """Result of `merge_recordings`.

    rows : of each recording. starts_s : merged time at which each begins.
    gap_known : whether the sidecars say when the recordings began; if not, ASSUMED_GAP_S lies between them.
    """

    rows: tuple[int, ...]
    starts_s: tuple[float, ...]
    gap_known: bool


def merge_recordings(recordings: Sequence[Recording], path: Path, overwrite: bool = False) -> MergeResult:
    """Write NAME.csv or NAME.parquet (`path`) and NAME.yaml with the rows of all recordings, in the order given.

    Sessions, visits and points are numbered on, so that none of two recordings is taken for the same. Columns that
    a recording does not have are empty in its rows. Raises RecordingError with everything in which the recordings do
    not fit together.
    """
    if problems := _problems(recordings):
        raise RecordingError(problems)
    starts_s, gap_known = _start_times_s(recordings)
    names = list(dict.fromkeys(name for recording in recordings for name in recording.columns))
    columns = {name: np.concatenate([_column(recording, name) for recording in recordings]) for name in names}
    columns["time_s"] = np.concatenate(
        [
            recording.time_s - recording.time_s[0] + start_s
            for recording, start_s in zip(recordings, starts_s, strict=True)
        ]
    )
    for name in _RENUMBERED:
        if name in columns:
            columns[name] = _renumber([_ids(recording, name) for recording in recordings])
    write_recording(path, columns, _sidecar(recordings, starts_s), overwrite)
    return MergeResult(tuple(recording.rows for recording in recordings), tuple(starts_s), gap_known)


def _problems(recordings: Sequence[Recording]) -> list[Problem]:
    """All contradictions between the recordings."""
    first, *others = recordings
    problems = [
        Problem(
            str(recording.sidecar.path),
            f"{_fitted_anew(recording)} fitted anew for every recording",
            value=f"reference.quantity: {recording.reference.quantity}"
            if recording.reference.of_fixed_places
            else "reference.frame: instrument",
            allowed="tool_position, tool_pose, link_length" if recording.reference.of_fixed_places else "machine",
            next_step="compare and diagnose it by itself",
        )
        for recording in recordings
        if recording.reference is not None and recording.reference.frame == "instrument"
    ]
    problems += [
        Problem(
            str(recording.sidecar.path),
            "recordings of several reflectors are not merged: each names its own",
            value="reference.reflectors",
            next_step="give them to `compd calibrate` side by side",
        )
        for recording in recordings
        if recording.target_P_mm is not None and recording.reference and recording.reference.frame == "machine"
    ]
    problems += [
        Problem(
            str(recording.path),
            "has no time, so that nothing says when it began",
            allowed="recordings with `time_s`",
            next_step="put its rows into one table with a column `session`, or diagnose it by itself",
        )
        for recording in recordings
        if not recording.has_time
    ]
    for recording in others:
        comparisons = (
            ("is of another machine", recording.machine, first.machine, "leave it out"),
            ("has another reference", _reference_text(recording), _reference_text(first), "diagnose it by itself"),
            ("has other folds", _folds_text(recording), _folds_text(first), "write the same `folds:` in both"),
            (
                "was recorded from another machine zero",
                _zero_time(recording),
                _zero_time(first),
                "measure again from the first zero: it survives a restart of the daemon",
            ),
            (
                "has other quantities at machine zero",
                _at_zero_text(recording),
                _at_zero_text(first),
                "write the same `quantities_at_zero:` in both, if both were measured from one machine zero",
            ),
        )
        problems += [
            Problem(str(recording.sidecar.path), what, value=value, allowed=allowed, next_step=next_step)
            for what, value, allowed, next_step in comparisons
            if value != allowed
        ]
    return problems


def _fitted_anew(recording: Recording) -> str:
    """Parts of the reference that are specific to a recording, with their verb."""
    assert recording.reference is not None
    if recording.reference.of_fixed_places:
        return f"the places of the {'pins' if recording.reference.quantity == 'fixed_point' else 'fixed balls'} are"
    return "the instrument's own frame is"


def _reference_text(recording: Recording) -> str:
    reference = recording.reference
    if reference is None:
        return "none"
    attitude = f", {reference.sigma_urad:g} urad" if np.isfinite(reference.sigma_urad) else ""
    return f"{reference.quantity}, {reference.frame}, sigma {reference.standard_uncertainty} {reference.unit}{attitude}"


def _folds_text(recording: Recording) -> str:
    return ", ".join(recording.sidecar.folds) or "no `folds:`"


def _at_zero_text(recording: Recording) -> str:
    at_zero = recording.sidecar.quantities_at_zero
    if at_zero is None:
        return "no `quantities_at_zero:`"
    return ", ".join(f"{name} {value!r}" for name, value in sorted(at_zero.items())) or "none"


def _zero_time(recording: Recording) -> str:
    """Time at which machine zero was taken; "" if the sidecar lacks it."""
    return str(recording.sidecar.provenance.get("zero_taken_at", ""))


def _start_times_s(recordings: Sequence[Recording]) -> tuple[list[float], bool]:
    """Merged time of each recording's start, and whether it is from the sidecars.

    It is not where a sidecar does not say when its recording began, or where one began before the one before it ended.
    """
    duration_s = [float(recording.time_s[-1] - recording.time_s[0]) for recording in recordings]
    began_s = [time_s for recording in recordings if (time_s := _calendar_time_s(recording)) is not None]
    gap_known = len(began_s) == len(recordings) and all(
        later_s - earlier_s > length_s
        for length_s, (earlier_s, later_s) in zip(duration_s, pairwise(began_s), strict=False)
    )
    steps_s = (
        [later_s - earlier_s for earlier_s, later_s in pairwise(began_s)]
        if gap_known
        else [length_s + ASSUMED_GAP_S for length_s in duration_s[:-1]]
    )
    starts_s = [0.0]
    for step_s in steps_s:
        starts_s.append(starts_s[-1] + step_s)
    return starts_s, gap_known


def _calendar_time_s(recording: Recording) -> float | None:
    """Calendar time (s) of the recording's start; None if its sidecar lacks it."""
    try:
        return datetime.fromisoformat(str(recording.sidecar.provenance.get("started_at"))).timestamp()
    except ValueError:
        return None


def _column(recording: Recording, name: str) -> FloatArray:
    """(N,) the column as in the file; nan if the recording lacks it."""
    return recording.columns.get(name, np.full(recording.rows, np.nan))


def _ids(recording: Recording, name: str) -> FloatArray:
    """(N,) ids, nan for none; a recording without sessions is one session beside those of others."""
    if name == "session" and name not in recording.columns:
        return np.zeros(recording.rows)
    return _column(recording, name)


def _renumber(ids_by_recording: Sequence[FloatArray]) -> FloatArray:
    """All ids numbered from 1 in the order of the recordings, and within a recording in their own order.

    Example: [3, 5, 5], [3, nan] -> [1, 2, 2, 3, nan].
    """
    renumbered, used = [], 0
    for ids in ids_by_recording:
        numbers, inverse = np.unique(ids[~np.isnan(ids)], return_inverse=True)
        new_ids = np.full(len(ids), np.nan)
        new_ids[~np.isnan(ids)] = used + 1 + inverse
        used += len(numbers)
        renumbered.append(new_ids)
    return np.concatenate(renumbered)


def _sidecar(recordings: Sequence[Recording], starts_s: Sequence[float]) -> dict[str, Any]:
    """The merged recording's sidecar: the common reference, excluded rows renumbered, and the origin of every row."""
    reference = recordings[0].reference
    reference_contents: dict[str, Any] | None = None
    if reference is not None:
        reference_contents = {"quantity": reference.quantity, "frame": reference.frame}
        if reference.unit != "um":
            reference_contents["unit"] = reference.unit
        if np.isfinite(reference.sigma_urad):
            reference_contents["sigma_urad"] = reference.sigma_urad
        sigma = [value for value in reference.standard_uncertainty if np.isfinite(value)]
        if sigma:
            reference_contents[sigma_key(reference.unit)] = sigma[0] if len(sigma) == 1 else sigma
    rows_before = 0
    excluded: dict[int, str] = {}
    trusted: dict[int, str] = {}
    for recording in recordings:
        excluded |= {rows_before + row: reason for row, reason in recording.exclusions_by_position().items()}
        own = recording.sidecar.trusted
        trusted |= {rows_before + k + 2: own[row] for k, row in enumerate(recording.row.tolist()) if row in own}
        rows_before += recording.rows
    sources = [
        {
            "recording": recording.path.name,
            "sha256": recording.sha256,
            "rows": recording.rows,
            "starts_s": round(start_s, 6),
            "provenance": dict(recording.sidecar.provenance),
        }
        for recording, start_s in zip(recordings, starts_s, strict=True)
    ]
    first = recordings[0].sidecar
    machine_files = {file and file.resolve() for file in (recording.sidecar.machine_file for recording in recordings)}
    return sidecar_contents(
        first.machine,
        reference_contents,
        excluded,
        {"merge": sources},
        folds=first.folds,
        quantities_at_zero=first.quantities_at_zero,
        trusted=trusted,
        machine_file=first.machine_file if len(machine_files) == 1 else None,
    )
