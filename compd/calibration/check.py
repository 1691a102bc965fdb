"""Whether a calibration still holds on another day, and which numbers have changed since.

With d = z - J x what the calibrated machine leaves of the new poses, in standard deviations of the noise and beside the
registration, its covariance is V = 1 + J C J^T, C that of the calibration. A number k that has changed by y leaves
J_k y. The change that lowers d^T V^-1 d most is taken, if it is beyond chance among all numbers; then all that were
taken are estimated together, and the next is looked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtri, ndtri

from compd.arrays import FloatArray, IntArray, rms
from compd.calibration.calibration import Calibration, PoseErrors
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.jacobian import without
from compd.calibration.machine_fit import declared_mm, registered_mm, scatter_mm, unexplained_poses, whitened_poses
from compd.calibration.parameters import Parameters, calibration_parameters
from compd.calibration.pose_errors import errors_alone
from compd.calibration.poses import MeasuredPoses, PosesNow, links_of_pose
from compd.comparison import AlignedRecording
from compd.text import join_words, nan_to_null

# Numbers of which a change is told, at most.
_MOST = 12


class NumberChange(NamedTuple):
    """A number that has changed: by `change` with its standard error, in `unit`."""

    name: str
    element: str
    unit: str
    change: float
    std: float


class CalibrationCheck(NamedTuple):
    """What another day says of a calibration.

    errors : at its poses, as drawn and calibrated.  misfit : mean square of what is left over what the noise and the
    uncertainty of the calibration leave, 1 where it holds.  limit : what chance alone exceeds once in 1,000.
    changes : numbers that have changed; empty where it holds, or where no number explains it.
    gross : rows that no noise explains, as a spreadsheet shows them; they are left out.
    """

    errors: PoseErrors
    misfit: float
    limit: float
    changes: tuple[NumberChange, ...]
    gross: tuple[int, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether nothing more than chance is left, and no number has changed."""
        return not self.changes and self.misfit <= self.limit

    @property
    def verdict(self) -> str:
        """In a sentence."""
        error = f"{self.errors.what}: {self.errors.after_rms_um:.3g} um (rms per coordinate)"
        if self.gross:
            error += f" without row{'s'[: len(self.gross) > 1]} {join_words([str(row) for row in self.gross], 'and')}"
        if self.holds:
            return f"{error}; the calibration holds."
        if not self.changes:
            return (
                f"{error}, {self.misfit**0.5:.2g} times what noise and the calibration's uncertainty make; no number "
                "of the machine explains it: `compd diagnose` looks for its cause."
            )
        return f"{error}; the calibration does not hold: {len(self.changes)} of its numbers changed."

    def as_json(self) -> dict[str, Any]:
        """As plain data; nan is None."""
        data = {
            "holds": self.holds,
            "verdict": self.verdict,
            "rms_um": self.errors.after_rms_um,
            "misfit": self.misfit,
            "limit": self.limit,
            "changes": [change._asdict() for change in self.changes],
            "gross": list(self.gross),
        }
        return dict(nan_to_null(data))


def check_calibration(
    calibration: Calibration, learned: Sequence[AlignedRecording], later: AlignedRecording
) -> CalibrationCheck:
    """The calibration beside poses of another day.

    learned : the recordings that it was learned from, which fix what its numbers are.  later : of the same machine.
    """
    model = learned[0].model
    assert model is not None
    rows = learned[0].rows.extended_by(*(one.rows for one in learned[1:]))
    parameters = calibration_parameters(model, rows, learned[0].ranges)
    poses = MeasuredPoses.of(later, parameters)
    to_links = links_of_pose(later) if calibration.in_links else None
    if to_links is not None and to_links.shape[1] == to_links.shape[2]:
        poses = replace(poses, to_links=to_links)
    now = poses.now(calibration.fitted)
    sigma_mm = _sigma_mm(calibration, learned[0], now)
    use, C = _known(calibration, parameters, all(one.target is not None for one in learned))
    free = np.isin(np.arange(len(parameters.names)), use)
    outlier = unexplained_poses([now], [sigma_mm], np.zeros(len(free)), parameters, free)[0]
    now = poses.now(calibration.fitted, outlier)
    part = whitened_poses(now, now.use & ~outlier, sigma_mm)
    both = without(np.column_stack([part.J, part.z]), part.R)
    J, d = both[:, :-1][:, use], both[:, -1]
    unit = (parameters.prior_std * parameters.per_theta)[use]
    dof = len(d) - part.R.shape[1]
    inverse = np.linalg.inv(np.eye(len(d)) + J @ C @ J.T)
    limit = float(ndtri(1 - (1 - CalibrationCriteria.check_confidence) / 2 / len(use)))
    taken: list[int] = []
    y: FloatArray = np.zeros(0)
    covariance: FloatArray = np.zeros((0, 0))
    for _ in range(_MOST):
        left = d - J[:, taken] @ y
        weighted = inverse @ J
        own = (J * weighted).sum(axis=0)
        if taken:
            cross = weighted.T @ J[:, taken]
            own = own - np.einsum("kt,ts,ks->k", cross, covariance, cross)
        told = own > 1e-9 * (J * weighted).sum(axis=0).max()
        score = np.where(told, (weighted.T @ left) / np.sqrt(np.where(told, own, 1.0)), 0.0)
        score[taken] = 0.0
        best = int(np.abs(score).argmax())
        if abs(score[best]) < limit:
            break
        taken.append(best)
        A = J[:, taken]
        covariance = np.asarray(np.linalg.inv(A.T @ inverse @ A), dtype=np.float64)
        y = covariance @ (A.T @ inverse @ d)
    misfit = float(d @ inverse @ d) / dof
    changes = tuple(
        NumberChange(
            parameters.names[use[k]],
            parameters.elements[use[k]],
            parameters.units[use[k]],
            float(y[i] * unit[k]),
            float(np.sqrt(covariance[i, i]) * unit[k]),
        )
        for i, k in enumerate(taken)
    )
    errors = errors_alone(later.recording.path.name, poses, calibration.fitted, outlier)
    gross = tuple(later.recording.row[outlier].tolist())
    return CalibrationCheck(
        errors, misfit, float(chdtri(dof, 1 - CalibrationCriteria.check_confidence)) / dof, changes, gross
    )


def _known(calibration: Calibration, parameters: Parameters, placed: bool) -> tuple[IntArray, FloatArray]:
    """Which of the P numbers a calibration has, and their covariance in tolerances.

    placed : whether it had targets whose place was fitted along. They leave the place of the tip at its tolerance.
    """
    have = {number.name: k for k, number in enumerate(calibration.numbers)}
    own = [k for k, name in enumerate(parameters.names) if name in have]
    tip = [k for k, name in enumerate(parameters.names) if placed and name.startswith("tool_offset.")]
    use = np.array([*own, *(k for k in tip if k not in own)], dtype=np.int64)
    unit = (parameters.prior_std * parameters.per_theta)[use]
    C = np.eye(len(use))
    places = [have[parameters.names[k]] for k in own]
    C[: len(own), : len(own)] = (calibration.covariance / np.outer(unit[: len(own)], unit[: len(own)]))[
        np.ix_(places, places)
    ]
    return use, C


def _sigma_mm(calibration: Calibration, learned: AlignedRecording, now: PosesNow) -> FloatArray:
    """(w,) standard deviation of the later poses: what the calibration found of the same instrument, else declared.

    What the machine does beyond its numbers it does on another day as well: the excess of what was found over what was
    declared. Where neither is known, what is left.
    """
    width = now.weighed[0].shape[1]
    if len(calibration.sigma_mm) == width and _instrument(learned) == _instrument(now.aligned):
        return calibration.sigma_mm
    declared = declared_mm(now, width)
    stated_mm = rms(learned.recording.reference_sigma_mm)
    lengths = calibration.sigma_mm[: len(calibration.sigma_mm) - 3 * learned.with_attitude]
    excess_mm2 = max(rms(lengths) ** 2 - stated_mm**2, 0.0) if len(lengths) and stated_mm > 0 else 0.0
    declared[now.aligned.lengths] = np.sqrt(declared[now.aligned.lengths] ** 2 + excess_mm2)
    found: FloatArray = scatter_mm(now, registered_mm(now, now.use)[0][now.use])
    return np.where(np.isfinite(declared), declared, found)


def _instrument(aligned: AlignedRecording) -> str:
    """What was measured and how well, to compare."""
    reference = aligned.recording.reference
    return "" if reference is None else f"{reference.quantity} {reference.sigma_um} {reference.sigma_urad}"
