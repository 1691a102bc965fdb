"""The rows of a joined recording: for each point of the instrument the gauges' readings in its dwell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray, TextArray
from compd.columns import ATTITUDE_COLUMNS, POSITION_COLUMNS, link_reference_column
from compd.instruments import ATTITUDE_AXES, LENGTH_AXES, InstrumentExport
from compd.joining.assignment import REPEAT_MM
from compd.joining.by_time import Instrument
from compd.joining.dwells import Dwell, dwell_columns
from compd.recording import Recording, sidecar_contents

# Interval (s) of the rows of repeats in a dwell of one row; shorter if the next dwell is near.
_REPEATS_EVERY_S = 1.0
# Largest distance (mm) of dwells at one nominal place, without ids of points: a corrected target moves by some 0.01 mm
# at each visit.
SAME_PLACE_MM = 2 * REPEAT_MM


def joined_columns(
    recording: Recording,
    dwells: Sequence[Dwell],
    dwell_of: IntArray,
    visit_of: IntArray,
    places_mm: FloatArray,
    export: InstrumentExport,
    instrument: Instrument,
) -> dict[str, FloatArray | TextArray]:
    """Name -> (R,) the columns, one row for each point with a dwell, in the order of the dwells.

    dwell_of : (G,) number of each point's dwell from 0, -1 for none. visit_of : (G,) the same for repeats,
        rising with the dwell. places_mm : (D, d) expected places.
    A dwell of as many rows as it has points keeps its rows, where the recording says by `point` that they are at rest;
    in any other the readings are averaged, and the times of several points are spread over the dwell. A recording
    without `time_s` is joined without it.
    """
    order: list[int] = []
    dwell_numbers: list[int] = []
    rows_of: list[IntArray] = []
    times_s: list[float] = []
    for i in range(len(dwells)):
        points = np.flatnonzero(dwell_of == i)
        points = points[np.argsort(visit_of[points], kind="stable")]
        rows = dwells[i].rows
        one_by_one = recording.point is not None and len(rows) == len(points)
        order += points.tolist()
        dwell_numbers += [i] * len(points)
        rows_of += [rows[k : k + 1] for k in range(len(rows))] if one_by_one else [rows] * len(points)
        times_s += recording.time_s[rows].tolist() if one_by_one else _times_s(recording, dwells[i], len(points))
    columns: dict[str, FloatArray | TextArray] = {**recording.with_texts(dwell_columns(recording, rows_of))}
    if recording.has_time:
        columns["time_s"] = np.array(times_s)
    if recording.point is None:
        columns["point"] = _place_numbers(places_mm, export, dwell_of)[dwell_numbers]
    columns["visit"] = _numbered(visit_of[order])
    if instrument.reflectors:
        assert export.reflector is not None
        columns["reflector"] = np.array(export.reflector, dtype=object)[order]
    values = export.values[order]
    if export.axes == LENGTH_AXES and instrument.link is not None:
        columns[link_reference_column(instrument.link)] = values[:, 0]
    else:
        names = POSITION_COLUMNS + (ATTITUDE_COLUMNS if _has_attitude(export) else ())
        columns |= dict(zip(names, values.T, strict=True))
    return columns


def joined_sidecar(
    recording: Recording,
    export: InstrumentExport,
    instrument: Instrument,
    by: str,
    rows: int,
    points: int,
    rms_mm: float,
    next_best: tuple[int, float] | None,
) -> dict[str, Any]:
    """The sidecar: what the reference is, and by what it was joined."""
    reference: dict[str, Any] = {"quantity": "link_length"} if instrument.link else {"quantity": "tool_position"}
    if not instrument.link:
        reference = {"quantity": "tool_pose" if _has_attitude(export) else "tool_position", "frame": instrument.frame}
    if instrument.sigma_um is not None:
        reference["sigma_um"] = instrument.sigma_um
    if instrument.reflectors:
        reference["reflectors"] = {name: list(place) for name, place in instrument.reflectors.items()}
    joined: dict[str, Any] = {
        "by": by,
        "gauges": recording.path.name,
        "gauges_sha256": recording.sha256,
        "instrument": export.path.name,
        "points": points,
        "joined_points": rows,
        "distances_rms_mm": round(rms_mm, 6),
    }
    if next_best is not None:
        joined["next_best"] = {"shift": next_best[0], "distances_rms_mm": round(next_best[1], 6)}
    provenance = {**recording.sidecar.provenance, "join": joined}
    sidecar = recording.sidecar
    return sidecar_contents(
        recording.machine,
        reference,
        {},
        provenance,
        sidecar.notes,
        sidecar.folds,
        sidecar.quantities_at_zero,
        machine_file=sidecar.machine_file,
    )


def _has_attitude(export: InstrumentExport) -> bool:
    return export.axes[3:] == ATTITUDE_AXES


def _times_s(recording: Recording, dwell: Dwell, count: int) -> list[float]:
    """Times of `count` points within the dwell: its middle, or several spread over it."""
    if count == 1:
        return [dwell.middle_s]
    start_s, end_s = dwell.time_s
    if end_s == start_s:
        later = recording.time_s[recording.time_s > end_s]
        end_s = start_s + min(_REPEATS_EVERY_S * count, float(later[0] - start_s) / 2.0 if len(later) else np.inf)
    return [start_s + (end_s - start_s) * (k + 0.5) / count for k in range(count)]


def _place_numbers(places_mm: FloatArray, export: InstrumentExport, dwell_of: IntArray) -> FloatArray:
    """(D,) number of the nominal place, from 1, the same for dwells near each other or whose points have one name."""
    count = len(places_mm)
    number = np.arange(count)
    for i in range(count):
        near = np.flatnonzero(np.linalg.norm(places_mm[:i] - places_mm[i], axis=1) <= SAME_PLACE_MM)
        if len(near):
            number[i] = number[near[0]]
    if export.name is not None:
        first_of: dict[str, int] = {}
        for name, i in zip(export.name, dwell_of.tolist(), strict=True):
            if i >= 0 and name:
                number[number == number[i]] = number[first_of.setdefault(name, i)]
    return _numbered(number)


def _numbered(labels: IntArray) -> FloatArray:
    """(N,) labels as numbers from 1, in the order of the labels."""
    return np.asarray(np.unique(labels, return_inverse=True)[1] + 1, dtype=np.float64)
