"""What could be measured next on a machine of an external model: programmes of settings within given limits."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.columns import approach_columns, scale_columns
from compd.comparison import AlignedRecording
from compd.errors import CompdError, Problem
from compd.link_count import scale_count
from compd.model.effects import Effect, Observations, evaluate_basis, needed_quantities
from compd.plan_file import TIP_COLUMNS, settings_row
from compd.planning.measurement_settings import MAX_COMBINATIONS, Setting, SettingLimits, settings_of
from compd.planning.programme_rows import ProgrammeRows, programme_starts, reversals_mm, step_times_s

# A step of a setting is watched for two hours, as long as machines take to warm through, or for 12 minutes.
WATCHED_S = (7200.0, 720.0)
# Rows on which it is tried whether an effect depends on the place: where it does, hardly any row hides it.
PROBED_ROWS = 50
# Derivatives of the external model's prediction: known where it was computed, on the recorded rows.
_SENSITIVITY = re.compile(r"d_\w+_(?:[xyz]|\{axis\}|link_(?:\d+|\{link\}))_mm")


class _Programmes(NamedTuple):
    """Programmes of one kind, r rows in all.

    lengths : (k,) rows of each.  time_s : (r,) from the start of the programme.  columns : name -> (r,) what is set.
    """

    purpose: str
    lengths: IntArray
    time_s: FloatArray
    columns: Mapping[str, FloatArray]


def setting_programmes(aligned: AlignedRecording, effects: Sequence[Effect], limits: SettingLimits) -> ProgrammeRows:
    """Settings of the columns that `effects` are computed from, within the limits.

    A grid of all settings, one row each. Where an effect remembers, also reversals of a link, and steps of one setting
    that are watched; where one changes with time, the same settings again later. Where an effect is computed from
    derivatives of the external model's prediction, which are known where that was computed, the recorded rows again.

    limits : by column, where they are not those of the recording.
    Raises CompdError where a limit is given for a column that none of the effects is computed from, or leaves no value.
    """
    usable = aligned.usable.mask
    recorded = _recorded_columns(aligned)
    names = [name for name in _column_names(aligned, effects) if name in recorded]
    _check_names(limits, names)
    if any(_SENSITIVITY.fullmatch(need) for effect in effects for need in effect.needs):
        return _recorded_rows(aligned, recorded, limits)
    settings = settings_of({name: recorded[name][usable] for name in names}, limits)
    programmes = [_grid(settings)] if settings else []
    if any(effect.remembers for effect in effects):
        programmes += _reversals(settings, scale_count(aligned.rows.links))
    if any(effect.remembers and "time" in effect.needs for effect in effects):
        programmes += _watched_steps(settings)
    if any("time" in effect.needs for effect in effects):
        programmes += [_later(settings, watched_s) for watched_s in WATCHED_S]
    return _programme_rows(aligned, programmes, recorded, names)


def recorded_settings(aligned: AlignedRecording, effects: Sequence[Effect]) -> dict[str, FloatArray]:
    """What was recorded of the columns that `effects` are computed from: name -> values of the usable rows."""
    recorded, usable = _recorded_columns(aligned), aligned.usable.mask
    return {name: recorded[name][usable] for name in _column_names(aligned, effects) if name in recorded}


def _recorded_columns(aligned: AlignedRecording) -> dict[str, FloatArray]:
    """Name -> (N,) of every column that has a value in a usable row."""
    columns = {**aligned.rows.quantities, **_motion_columns(aligned.rows)}
    return {name: values for name, values in columns.items() if np.isfinite(values[aligned.usable.mask]).any()}


def _column_names(aligned: AlignedRecording, effects: Sequence[Effect]) -> list[str]:
    """The columns that the effects are computed from, in the order in which they name them; places and motion last."""
    names = [name for effect in effects for name in needed_quantities(effect, aligned.rows.links)]
    rows = aligned.rows.select(np.flatnonzero(aligned.usable.mask)[:PROBED_ROWS])
    for field, columns in _motion_names(rows).items():
        for k, name in enumerate(columns):
            framed = aligned.registered and name in TIP_COLUMNS
            if framed or any(_depends_on(effect, rows, field, k) for effect in effects):
                names.append(name)
    return list(dict.fromkeys(names))


def _depends_on(effect: Effect, rows: Observations, field: str, k: int) -> bool:
    """Whether what an effect does changes with column k of an array of the observations.

    That is another number in each row, because some effects follow what changes from row to row.
    """
    moved: dict[str, Any] = {field: np.array(getattr(rows, field))}
    moved[field][:, k] += 1.0 + np.arange(len(rows))
    grid = effect.constant_grid(rows)
    # at one end of its grid an effect may be so quick or so short that it forgets everything between two rows
    for constants in (grid[0], grid[-1]):
        (here, _), (there, _) = (
            evaluate_basis(effect, known, constants, None) for known in (rows, replace(rows, **moved))
        )
        if not np.array_equal(here, there, equal_nan=True):
            return True
    return False


def _motion_names(rows: Observations) -> dict[str, Sequence[str]]:
    """The arrays of observations that say where the machine is and how it moves: field -> name of each column."""
    scales = scale_count(rows.links)
    return {
        "tip_M_mm": TIP_COLUMNS,
        "scale_mm": scale_columns(scales),
        "direction": approach_columns(scales),
        "velocity_mm_per_s": [f"velocity_{i}_mm_per_s" for i in range(1, scales + 1)],
    }


def _motion_columns(rows: Observations) -> dict[str, FloatArray]:
    return {
        name: getattr(rows, field)[:, k] for field, names in _motion_names(rows).items() for k, name in enumerate(names)
    }


def _check_names(limits: SettingLimits, names: Sequence[str]) -> None:
    problems = [
        Problem(
            f"limit of {name}",
            "is no column that these effects are computed from",
            allowed=", ".join(names) or "none: they are computed from no column",
            next_step="correct the name, or leave the limit out",
        )
        for name in limits
        if name not in names
    ]
    if problems:
        raise CompdError(problems)


def _grid(settings: Sequence[Setting]) -> _Programmes:
    """All combinations of the settings' values, one row each; of too many a part that fills the space evenly."""
    sizes = [len(setting.values) for setting in settings]
    if math.prod(sizes) <= MAX_COMBINATIONS:
        places = np.indices(tuple(sizes)).reshape(len(sizes), -1)
    else:
        from scipy.stats import qmc  # takes a third of a second, and is seldom needed

        points = qmc.Sobol(len(sizes), scramble=False).random(MAX_COMBINATIONS)
        places = np.unique((points * sizes).astype(np.int64), axis=0).T
    columns: dict[str, FloatArray] = {}
    for setting, place in zip(settings, places, strict=True):
        columns |= setting.columns(setting.values[place])
    count = places.shape[1]
    return _Programmes("at these settings", np.ones(count, dtype=np.int64), np.zeros(count), columns)


def _watched_steps(settings: Sequence[Setting]) -> list[_Programmes]:
    """A step of one setting from end to end and what follows, the others in the middle."""
    steps = []
    for setting in settings:
        if setting.is_direction or len(setting.values) == 1:
            continue
        for begin, end in (setting.values[[0, -1]], setting.values[[-1, 0]]):
            for watched_s in WATCHED_S:
                time_s = step_times_s(watched_s)
                others = _in_the_middle([other for other in settings if other is not setting], len(time_s))
                columns = others | setting.columns(np.where(time_s > 0, end, begin))
                purpose = f"a step of {setting.name}, watched"
                steps.append(_Programmes(purpose, np.array([len(time_s)]), time_s, columns))
    return steps


def _reversals(settings: Sequence[Setting], links: int) -> list[_Programmes]:
    """Reversals of one link in growing steps, the others in the middle, where its place and its direction are set."""
    by_name = {setting.name: setting for setting in settings}
    reversals = []
    for scale, approach in zip(scale_columns(links), approach_columns(links), strict=True):
        if scale in by_name and approach in by_name:
            place = by_name[scale]
            path_mm = reversals_mm((place.values[-1] - place.values[0]) / 2)
            others = _in_the_middle([other for other in settings if other.name not in (scale, approach)], len(path_mm))
            columns = others | place.columns((place.values[0] + place.values[-1]) / 2 + path_mm)
            columns |= by_name[approach].columns(np.sign(np.diff(path_mm, prepend=-1.0)))
            purpose = f"reversals of {scale} in growing steps"
            reversals.append(_Programmes(purpose, np.array([len(path_mm)]), np.zeros(len(path_mm)), columns))
    return reversals


def _later(settings: Sequence[Setting], after_s: float) -> _Programmes:
    """The same settings twice."""
    return _Programmes(
        "the same settings again later", np.array([2]), np.array([0.0, after_s]), _in_the_middle(settings, 2)
    )


def _in_the_middle(settings: Sequence[Setting], count: int) -> dict[str, FloatArray]:
    columns: dict[str, FloatArray] = {}
    for setting in settings:
        columns |= setting.columns(np.full(count, setting.middle))
    return columns


def _programme_rows(
    aligned: AlignedRecording,
    programmes: Sequence[_Programmes],
    recorded: Mapping[str, FloatArray],
    shown: Sequence[str],
) -> ProgrammeRows:
    """The rows of all programmes. recorded : columns (N,), in the middle of which is held what is not set.

    shown : the columns of the plan's file.
    """
    usable = aligned.usable.mask
    count = sum(len(kind.time_s) for kind in programmes)
    columns = {
        name: np.concatenate(
            [
                np.zeros(0),
                *(
                    kind.columns.get(name, np.full(len(kind.time_s), np.nanmedian(values[usable])))
                    for kind in programmes
                ),
            ]
        )
        for name, values in recorded.items()
    }
    lengths = np.concatenate([np.zeros(0, dtype=np.int64), *(kind.lengths for kind in programmes)])
    time_s = np.concatenate([np.zeros(0), *(kind.time_s for kind in programmes)])
    purposes = [kind.purpose for kind in programmes for _ in range(len(kind.time_s))]
    # whatever else observations hold stays as it was in some row
    rows = aligned.rows.select(np.full(count, np.flatnonzero(usable)[0]))
    motion: dict[str, Any] = {
        field: np.stack([columns.get(name, getattr(rows, field)[:, k]) for k, name in enumerate(names)], axis=1)
        for field, names in _motion_names(rows).items()
        if names
    }
    quantities = {name: columns.get(name, values) for name, values in rows.quantities.items()}
    rows = replace(rows, **motion, quantities=quantities, time_s=time_s, session_start=programme_starts(lengths))
    to_set = [
        settings_row(purpose, time_s[k], {name: columns[name][k] for name in shown})
        for k, purpose in enumerate(purposes)
    ]
    return ProgrammeRows(rows, lengths, to_set)


def _recorded_rows(
    aligned: AlignedRecording, recorded: Mapping[str, FloatArray], limits: SettingLimits
) -> ProgrammeRows:
    """The recording's rows within the limits, each a programme."""
    within = aligned.usable.mask.copy()
    for name, (low, high) in limits.items():
        within &= (low <= recorded[name]) & (recorded[name] <= high)
    index = np.flatnonzero(within)
    # of very many rows some, evenly over the recording
    index = index[np.linspace(0, len(index) - 1, min(len(index), MAX_COMBINATIONS)).astype(np.int64)]
    lengths = np.ones(len(index), dtype=np.int64)
    rows = replace(aligned.rows.select(index), session_start=programme_starts(lengths))
    shown = [name for name in recorded if not _SENSITIVITY.fullmatch(name)]
    to_set = [
        settings_row(
            f"row {aligned.recording.row[i]} of {aligned.recording.path.name} again",
            0.0,
            {name: recorded[name][i] for name in shown},
        )
        for i in index
    ]
    return ProgrammeRows(rows, lengths, to_set)
