"""Columns of the reference in another unit, or counted the other way, than the model's: told by their slopes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.criteria import ComparisonCriteria
from compd.data_fault import DataFault
from compd.text import join_words
from compd.units import REFERENCE_UNITS, UM_PER_MM, UNIT_KINDS

# Units that are mistaken for one another; of others a slope as large has another cause.
_MISTAKEN = ("nm", "um", "cm", "m", "inch", "urad", "mrad", "rad", "deg", "arcsec")


class _Slope(NamedTuple):
    """Slope of a column of the reference against what the model says of it, and the model's column beside it."""

    column: str
    model: str
    slope: float


def column_faults(aligned: AlignedRecording) -> list[DataFault]:
    """Columns of which a sign or a unit seems wrong; none where reference and model follow no common line."""
    faults: list[DataFault] = []
    slopes = list(_of_frame(aligned) if aligned.registered else _of_coordinates(aligned))
    reversed_columns = [each for each in slopes if each.slope < 0]
    if reversed_columns:
        names = join_words([each.column for each in reversed_columns])
        if aligned.registered:
            what = "the sign of one axis of the reference, or of all three, seems reversed: it is a mirror image"
        else:
            models = join_words([each.model for each in reversed_columns])
            slope = join_words([f"{each.slope:.3g}" for each in reversed_columns])
            what = f"the sign of {names} seems reversed: its slope against {models} is {slope}"
        faults.append(DataFault("a sign that seems reversed", (), (), what, "mend the column"))
    for each in slopes:
        sides = _sides(aligned, each)
        if sides:
            what = f"{' or '.join(sides)}: the slope of {each.column} against {each.model} is {each.slope:.5g}"
            faults.append(DataFault("a unit that seems to be another", (), (), what, "mend the column"))
    return faults


def _sides(aligned: AlignedRecording, each: _Slope) -> list[str]:
    """Which column seems to be in another unit, of the two that make a slope."""
    if each.slope == 0:
        return []
    ending, criteria, size = REFERENCE_UNITS[aligned.unit], aligned.criteria, abs(each.slope)
    columns = {each.column: _unit_of_slope(size, ending, criteria)}
    if aligned.model is None and not aligned.registered:
        columns[each.model] = _unit_of_slope(1 / size, ending, criteria)
    return [f"{name} seems to be in {unit}" for name, unit in columns.items() if unit]


def _unit_of_slope(slope: float, ending: str, criteria: ComparisonCriteria) -> str:
    """The unit in which values have this slope against values in the right one; "" for the right one, or for none."""
    kind = next((kind for kind in UNIT_KINDS if ending in kind), {})
    for unit in _MISTAKEN:
        if unit in kind and unit != ending and abs(slope * kind[unit] / kind[ending] - 1.0) <= criteria.slope_share:
            return unit
    return ""


def _of_coordinates(aligned: AlignedRecording) -> Iterator[_Slope]:
    """Each measured coordinate against its prediction, where all are in the frame of the model."""
    if aligned.ends is not None or aligned.recording.plate is not None:
        return  # calibrated places have no column of their own
    predicted_mm = aligned.predicted_mm({})
    use = aligned.usable.mask & np.isfinite(predicted_mm).all(axis=1) & np.isfinite(aligned.measured_mm).all(axis=1)
    ending = REFERENCE_UNITS[aligned.unit]
    for k, label in enumerate(aligned.label_names[: aligned.lengths.stop]):
        slope = _slope(aligned.measured_mm[use, k], predicted_mm[use, k], aligned.criteria)
        if slope is not None:
            own = f"model_{label}_{ending}" if aligned.model is None else f"the machine's {label.replace('_', ' ')}"
            yield _Slope(f"reference_{label}_{ending}", own, slope)


def _of_frame(aligned: AlignedRecording) -> Iterator[_Slope]:
    """Each axis of an instrument whose frame is turned, against the model; the first is negative in a mirror image."""
    measured_mm, predicted_mm = aligned.recording.reference_mm, aligned.nominal_tip_mm
    if measured_mm is None or measured_mm.shape[1] < 3 or aligned.recording.plate is not None:
        return
    use = aligned.usable.mask & np.isfinite(predicted_mm).all(axis=1) & np.isfinite(measured_mm).all(axis=1)
    if use.sum() < aligned.criteria.min_slope_rows:
        return
    q = measured_mm[use] - np.median(measured_mm[use], axis=0)
    p = predicted_mm[use] - np.median(predicted_mm[use], axis=0)
    spread = np.linalg.svd(p, compute_uv=False)
    if spread[-1] <= aligned.criteria.min_slope_spread * spread[0]:
        return  # points in a plane have no mirror image
    matrix, *_ = np.linalg.lstsq(p, q, rcond=None)
    left = q - p @ matrix
    if (np.median(np.abs(left), axis=0) > aligned.criteria.most_beside_slope * np.median(np.abs(q), axis=0)).any():
        return
    sign = float(np.sign(np.linalg.det(matrix)))
    for k, axis in enumerate("xyz"):
        size = float(np.linalg.norm(matrix[:, k]))
        yield _Slope(f"reference_{axis}_mm", "the model", size if k else sign * size)


def _slope(measured: FloatArray, predicted: FloatArray, criteria: ComparisonCriteria) -> float | None:
    """Slope of what was measured against what is predicted, (R,) each, where a line describes it; else None.

    The median of slopes between rows far apart (H. Theil, Proc. K. Ned. Akad. Wet. 53 (1950) 386): gross rows do not
    turn it.
    """
    if len(measured) < criteria.min_slope_rows or np.ptp(predicted) * UM_PER_MM < 1.0:
        return None
    order = np.argsort(predicted, kind="stable")
    half = len(order) // 2
    low, high = order[:half], order[-half:]
    apart = predicted[high] - predicted[low]
    far = apart > 0
    if not far.any():
        return None
    slope = float(np.median((measured[high] - measured[low])[far] / apart[far]))
    left = measured - slope * predicted
    away = np.median(np.abs(left - np.median(left)))
    moved = np.median(np.abs(measured - np.median(measured)))
    return slope if away <= criteria.most_beside_slope * moved and moved > 0 else None
