"""Errors at poses, before and after a calibration: of those learned from, of those left out, of sealed recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray, rms
from compd.calibration.calibration import PoseErrors
from compd.calibration.held_out import Fold
from compd.calibration.jacobian import without
from compd.calibration.machine_fit import MachineFit, fit_machine, registered_mm
from compd.calibration.poses import MeasuredPoses, PosesNow, links_of_pose
from compd.calibration.prior_fit import open_columns
from compd.model.effects import FittedEffect
from compd.units import UM_PER_MM


def errors_alone(what: str, poses: MeasuredPoses, fitted: tuple[FittedEffect, ...], outlier: BoolArray) -> PoseErrors:
    """Of one recording, registered by itself: as drawn, and with these effects. outlier : (N,) rows left out."""
    before, after = poses.now((), outlier), poses.now(fitted, outlier)
    use = before.use & after.use & ~outlier
    left = [registered_mm(now, use)[1] for now in (before, after)]
    return _errors(what, [(before, use, left[0], left[1])])


def errors_of_folds(what: str, fit: MachineFit, drawn: MachineFit, folds: Sequence[Fold]) -> PoseErrors:
    """Of rows that each fold leaves out, numbers and registration learned from the others; drawn : without numbers."""
    parts = []
    recordings = [now.poses for now in fit.now]
    for fold in folds:
        learned = [out | left for out, left in zip(fit.outlier, fold.left_out, strict=True)]
        after = fit_machine(recordings, fit.parameters, fit.free, fit.sets, learned, start=fit)
        before = fit_machine([now.poses for now in drawn.now], fit.parameters, drawn.free, outlier=learned, start=drawn)
        for k, left in enumerate(fold.left_out):
            test = left & ~fit.outlier[k] & before.now[k].use & after.now[k].use
            errors = [_left_of_fold(one.now[k], ~learned[k], test) for one in (before, after)]
            parts.append((after.now[k], test, errors[0], errors[1]))
    return _errors(what, parts)


def _left_of_fold(now: PosesNow, learned: BoolArray, test: BoolArray) -> FloatArray:
    """(N, m) registered by the rows learned from, or by those tested where these are too few or leave it open."""
    use, R_mm = now.use & learned, now.registration_mm
    values = R_mm.shape[1] * int(use.sum())
    use = use if values > 2 * R_mm.shape[2] else test
    left_mm = registered_mm(now, use)[1]
    if not test.any():
        return left_mm
    columns = open_columns(np.concatenate(R_mm[use]), np.concatenate(R_mm[test]))
    left_mm[test] = without(left_mm[test].reshape(-1, 1), columns).reshape(left_mm[test].shape)
    return left_mm


def _errors(what: str, parts: Sequence[tuple[PosesNow, BoolArray, FloatArray, FloatArray]]) -> PoseErrors:
    """parts : of each recording its rows (N,) that count, and (N, m) before and after, mm."""
    rows: list[IntArray] = []
    places: list[FloatArray] = []
    before: list[FloatArray] = []
    after: list[FloatArray] = []
    links: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    lengths: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    angles: tuple[list[FloatArray], list[FloatArray]] = ([], [])
    for now, use, *both in parts:
        aligned = now.poses.aligned
        to_links = links_of_pose(aligned)
        rows.append(aligned.recording.row[use])
        places.append(aligned.rows.tip_M_mm[use])
        for k, (left, tips) in enumerate(zip(both, (before, after), strict=True)):
            own = left[use]
            tips.append(own[:, :3] if aligned.shows_tip else np.full((len(own), 3), np.nan))
            count = aligned.rows.link_mm.shape[1]
            in_links = np.full((len(own), count), np.nan)
            if aligned.of_links:
                in_links[:, list(aligned.axes)] = own
            elif to_links is not None:
                in_links = (to_links[use] @ own[:, :, None])[:, :, 0]
            links[k].append(in_links)
            lengths[k].append(own[:, aligned.lengths].ravel())
            angles[k].append(own[:, -3:].ravel() if aligned.with_attitude else np.zeros(0))
    sizes = [[_rms_um(np.concatenate(values)) for values in kind] for kind in (lengths, angles)]
    return PoseErrors(
        what,
        np.concatenate(rows),
        np.concatenate(places),
        np.concatenate(before),
        np.concatenate(after),
        np.concatenate(links[0]),
        np.concatenate(links[1]),
        *sizes[0],
        *sizes[1],
    )


def _rms_um(values_mm: FloatArray) -> float:
    """nan of none; a urad of an attitude stands as a um."""
    return rms(values_mm) * UM_PER_MM if len(values_mm) else float("nan")
