"""What joints, frame and each effect do for the prediction: the error that is left with each of them switched off."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.fit import free_motion_of
from compd.model.deltas import Deltas, sum_deltas
from compd.units import UM_PER_MM


class Contribution(NamedTuple):
    """Per coordinate, rms in um: what the source moves the prediction by, and the residual without it."""

    share_rms_um: float
    without_rms_um: float


def contributions(
    aligned: AlignedRecording, by_effect: Mapping[str, Deltas], used: BoolArray
) -> dict[str, Contribution]:
    """By source: "joints" and "frame" where they were recorded, then each effect by its id.

    by_effect : what each effect adds at its ports.  used : (N,) the rows that count.
    Where the instrument's frame is fitted, it is fitted anew without each source.
    """
    whole = sum_deltas(list(by_effect.values()))
    predicted_mm = aligned.predicted_mm(whole)
    off: dict[str, Deltas] = {}
    if aligned.model is not None and aligned.recording.joint_mm is not None:
        off["joints"] = {**whole, "joint": -aligned.rows.joint_mm}
    if aligned.model is not None and aligned.recording.frame_mm is not None:
        off["frame"] = {**whole, "frame": -aligned.rows.frame_mm}
    for name in by_effect:
        off[name] = sum_deltas([added for other, added in by_effect.items() if other != name])
    found: dict[str, Contribution] = {}
    for name, added in off.items():
        without_mm = aligned.predicted_mm(added)
        good = used & np.isfinite(without_mm).all(axis=1)
        residual_um = (aligned.measured_mm - without_mm) * UM_PER_MM
        residual_um = residual_um - free_motion_of(aligned, residual_um, good)
        found[name] = Contribution(_rms(((predicted_mm - without_mm) * UM_PER_MM)[good]), _rms(residual_um[good]))
    return found


def _rms(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")
