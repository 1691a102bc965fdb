"""Several recordings of one machine as one: what was measured first, and what was measured next."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.errors import Problem, RecordingError
from compd.recording.columns import ID_COLUMNS
from compd.recording.recording import Recording
from compd.recording.writer import write_recording

# Where nobody knows how long after each other two recordings were made.
ASSUMED_GAP_S = 3600.0
# Numbers of the ball and of nothing else mean the same in every recording.
_RENUMBERED = tuple(name for name in ID_COLUMNS if name != "ball")


class Merged(NamedTuple):
    """rows : of each recording. starts_s : when each begins in merged time; gap_known : whether that is recorded."""

    rows: tuple[int, ...]
    starts_s: tuple[float, ...]
    gap_known: bool


def merge(recordings: Sequence[Recording], path: Path, overwrite: bool = False) -> Merged:
    """Write NAME.csv (`path`) and NAME.yaml with the rows of all, in the order given.

    Sessions, visits and points are numbered on, so that none of two recordings is taken for the same. Columns that
    one of them has not are empty there. Raises RecordingError with everything in which they do not fit together.
    """
    if problems := _problems(recordings):
        raise RecordingError(problems)
    began = [_began_s(one) for one in recordings]
    gap_known = None not in began and all(
        later - earlier > one.time_s[-1] - one.time_s[0]
        for one, earlier, later in zip(recordings, began, began[1:], strict=False)
        if earlier is not None and later is not None
    )
    starts_s = [0.0]
    for one, earlier, later in zip(recordings, began, began[1:], strict=False):
        passed_s = float(one.time_s[-1] - one.time_s[0]) + ASSUMED_GAP_S
        if gap_known and earlier is not None and later is not None:
            passed_s = later - earlier
        starts_s.append(starts_s[-1] + passed_s)
    names = list(dict.fromkeys(name for one in recordings for name in one.columns))
    columns = {name: np.concatenate([_column(one, name) for one in recordings]) for name in names}
    columns["time_s"] = np.concatenate(
        [one.time_s - one.time_s[0] + start for one, start in zip(recordings, starts_s, strict=True)]
    )
    for name in _RENUMBERED:
        if name in columns:
            columns[name] = _numbered_on([_ids(one, name) for one in recordings])
    write_recording(path, columns, _sidecar(recordings, starts_s), overwrite)
    return Merged(tuple(one.rows for one in recordings), tuple(starts_s), gap_known)


def _problems(recordings: Sequence[Recording]) -> list[Problem]:
    first, *others = recordings
    problems = []
    for one in recordings:
        reference = one.reference
        if reference is not None and reference.frame == "instrument":
            problems.append(
                Problem(
                    where=str(one.sidecar.path),
                    what="the instrument's own frame is fitted anew for every recording",
                    value="reference.frame: instrument",
                    allowed="machine",
                    next_step="compare and diagnose it by itself",
                )
            )
    for one in others:
        pairs = (
            ("is of another machine", one.machine, first.machine, "leave it out"),
            ("has another reference", _reference(one), _reference(first), "diagnose it by itself"),
            (
                "was recorded from another machine zero",
                _zero(one),
                _zero(first),
                "measure again from the first zero: it survives a restart of the daemon",
            ),
        )
        problems += [
            Problem(where=str(one.sidecar.path), what=what, value=here, allowed=there, next_step=step)
            for what, here, there, step in pairs
            if here != there
        ]
    return problems


def _reference(one: Recording) -> str:
    reference = one.reference
    return "none" if reference is None else f"{reference.quantity}, {reference.frame}, sigma {reference.sigma_um} um"


def _zero(one: Recording) -> str:
    return str(one.sidecar.provenance.get("zero_taken_at", ""))


def _began_s(one: Recording) -> float | None:
    """Seconds of the calendar at which the recording began; None where its sidecar does not say."""
    try:
        return datetime.fromisoformat(str(one.sidecar.provenance.get("started_at"))).timestamp()
    except ValueError:
        return None


def _column(one: Recording, name: str) -> FloatArray:
    return one.columns.get(name, np.full(one.rows, np.nan))


def _ids(one: Recording, name: str) -> FloatArray:
    """(N,) nan where there is none; a recording without sessions is one session beside others."""
    if name == "session" and name not in one.columns:
        return np.zeros(one.rows)
    return _column(one, name)


def _numbered_on(each: Sequence[FloatArray]) -> FloatArray:
    """The same numbers in the same order, every recording's after those before it, from 1."""
    found, used = [], 0
    for ids in each:
        numbers, inverse = np.unique(ids[~np.isnan(ids)], return_inverse=True)
        anew = np.full(len(ids), np.nan)
        anew[~np.isnan(ids)] = used + 1 + inverse
        used += len(numbers)
        found.append(anew)
    return np.concatenate(found)


def _sidecar(recordings: Sequence[Recording], starts_s: Sequence[float]) -> dict[str, Any]:
    reference = recordings[0].reference
    sidecar: dict[str, Any] = {"machine": recordings[0].machine}
    if reference is not None:
        sigma_um = [value for value in reference.sigma_um if np.isfinite(value)]
        sidecar["reference"] = {"quantity": reference.quantity, "frame": reference.frame} | (
            {"sigma_um": sigma_um[0] if len(sigma_um) == 1 else sigma_um} if sigma_um else {}
        )
    before, excluded = 0, []
    for one in recordings:
        excluded += [
            {"row": before + i + 2, "reason": one.sidecar.excluded[int(one.row[i])]}
            for i in np.flatnonzero(one.excluded).tolist()
        ]
        before += one.rows
    if excluded:
        sidecar["excluded_rows"] = excluded
    sidecar["provenance"] = {
        "merge": [
            {
                "recording": one.path.name,
                "sha256": one.sha256,
                "rows": one.rows,
                "starts_s": round(start_s, 6),
                "provenance": dict(one.sidecar.provenance),
            }
            for one, start_s in zip(recordings, starts_s, strict=True)
        ]
    }
    return sidecar
