"""What joints, frame and each effect do for the prediction: the error that is left with each of them switched off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, rms
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.nuisance import fit_along
from compd.model import Deltas, sum_deltas
from compd.model.effects import FittedEffect
from compd.units import UM_PER_MM


class Contribution(NamedTuple):
    """Per coordinate, rms in um: by how much the source moves the prediction, and the residual without the source."""

    share_rms_um: float
    without_rms_um: float


def contributions(
    aligned: AlignedRecording, fitted: Sequence[FittedEffect], by_effect: Mapping[str, Deltas], used: BoolArray
) -> dict[str, Contribution]:
    """The contribution of each source: "joints" and "frame" where they were recorded, then each effect by its id.

    fitted : the effects of the model.  by_effect : what each adds at its ports.  used : (N,) the rows that count.
    A source is switched off by predicting again without it: comparators as if unmoved, the effect left out of the sum.
    Nuisance terms are fitted anew without each source, as a user without it would have done.
    """
    predicted_mm = aligned.predicted_mm(sum_deltas(list(by_effect.values())))
    result: dict[str, Contribution] = {}
    for name, added in _deltas_without(aligned, by_effect).items():
        without_mm = aligned.predicted_mm(added)
        rows = used & np.isfinite(without_mm).all(axis=1)
        residual_um = (aligned.measured_mm - without_mm) * UM_PER_MM
        others = [effect for effect in fitted if effect.effect.id != name]
        residual_um = residual_um - fit_along(aligned, others, residual_um, rows).total_um
        moved_um = ((predicted_mm - without_mm) * UM_PER_MM)[rows][:, aligned.lengths]
        result[name] = Contribution(rms(moved_um), rms(residual_um[rows][:, aligned.lengths]))
    return result


def _deltas_without(aligned: AlignedRecording, by_effect: Mapping[str, Deltas]) -> dict[str, Deltas]:
    """What is added at the ports with each source switched off, by the names of `contributions`."""
    total = sum_deltas(list(by_effect.values()))
    without: dict[str, Deltas] = {}
    if aligned.model is not None and aligned.recording.joint_mm is not None:
        without["joints"] = {**total, "joint": -aligned.rows.joint_mm}
    if aligned.model is not None and aligned.recording.frame_mm is not None:
        without["frame"] = {**total, "frame": -aligned.rows.frame_mm}
    for name in by_effect:
        without[name] = sum_deltas([added for other, added in by_effect.items() if other != name])
    return without
