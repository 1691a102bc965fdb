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

from compd.arrays import BoolArray, FloatArray
from compd.calibration.calibration import Calibration, PoseErrors
from compd.calibration.jacobian import without
from compd.calibration.machine_fit import whitened_poses
from compd.calibration.parameters import calibration_parameters
from compd.calibration.pose_errors import errors_alone
from compd.calibration.poses import MeasuredPoses, links_of_pose
from compd.comparison import AlignedRecording
from compd.text import nan_to_null

# Confidence, over all numbers together, beyond which a change or a misfit is more than chance.
_CONFIDENCE = 0.999
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
    """

    errors: PoseErrors
    misfit: float
    limit: float
    changes: tuple[NumberChange, ...]

    @property
    def holds(self) -> bool:
        """Whether nothing more than chance is left, and no number has changed."""
        return not self.changes and self.misfit <= self.limit

    @property
    def verdict(self) -> str:
        """In a sentence."""
        error = f"{self.errors.what}: {self.errors.after_rms_um:.3g} um (rms per coordinate)"
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
    kept = {number.block for number in calibration.numbers}
    parameters = calibration_parameters(model, rows, learned[0].ranges)
    poses = MeasuredPoses.of(later, parameters)
    if calibration.in_links and (to_links := links_of_pose(later)) is not None:
        poses = replace(poses, to_links=to_links)
    now = poses.now(calibration.fitted)
    sigma_mm = calibration.sigma_mm
    outlier: BoolArray = np.zeros(len(now.use), dtype=bool)
    part = whitened_poses(now, now.use, sigma_mm)
    both = without(np.column_stack([part.J, part.z]), part.R)
    use = np.flatnonzero([name.split(".")[0] in kept for name in parameters.names])
    J, d = both[:, :-1][:, use], both[:, -1]
    unit = (parameters.prior_std * parameters.per_theta)[use]
    C = calibration.covariance / np.outer(unit, unit)
    dof = len(d) - part.R.shape[1]
    inverse = np.linalg.inv(np.eye(len(d)) + J @ C @ J.T)
    limit = float(ndtri(1 - (1 - _CONFIDENCE) / 2 / len(use)))
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
    return CalibrationCheck(errors, misfit, float(chdtri(dof, 1 - _CONFIDENCE)) / dof, changes)
