"""The numbers of a machine fitted to several recordings: robust Gauss-Newton on the forward model, with the prior.

In each round every instrument is registered again to the prediction so far (`aligned_with`), the noise of lengths and
of angles is taken from what is left, rows with an error that no noise explains are left out, and the linear problem of
`prior_fit` gives the next numbers. The derivatives by the numbers are taken once, on the machine as drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from compd.arrays import BoolArray, FloatArray, rms
from compd.calibration.parameters import Parameters
from compd.calibration.poses import MeasuredPoses, PosesNow
from compd.calibration.prior_fit import Normal, PriorFit, Whitened, fit_with_prior, normal_equations, registration_of
from compd.statistics import MIN_SIGMA, huber_weights, trimmed_scale
from compd.units import UM_PER_MM

# The forward model is nearly linear: three rounds settle numbers and outliers, the others are for large errors.
_ROUNDS = 12
# A change of the numbers, in tolerances, that ends the rounds.
_SETTLED = 1e-4
# Confidence at which a scatter contradicts the noise that is declared.
_CONTRADICTS = 0.99


@dataclass(frozen=True, eq=False)
class MachineFit:
    """Numbers fitted to K recordings.

    now : (K) what is left of each.  linear : (K) the linear problem about the result, in which z has what the numbers
    explain.  result : numbers and covariance in tolerances.  outlier : (K) of (N,).  sigma_mm : (K) of (m,).
    """

    parameters: Parameters
    now: tuple[PosesNow, ...]
    linear: tuple[Whitened, ...]
    result: PriorFit
    outlier: tuple[BoolArray, ...]
    sigma_mm: tuple[FloatArray, ...]
    free: BoolArray

    @property
    def theta(self) -> FloatArray:
        """(P,) in the effects' units."""
        return self.result.x * self.parameters.prior_std

    @property
    def covariance(self) -> FloatArray:
        """(P, P) of theta."""
        prior = self.parameters.prior_std
        return np.asarray(self.result.C * np.outer(prior, prior))

    @property
    def normal(self) -> Normal:
        """The linear problem of all numbers."""
        return normal_equations(self.linear)


def fit_machine(
    recordings: Sequence[MeasuredPoses],
    parameters: Parameters,
    free: BoolArray,
    considered: FloatArray | None = None,
    outlier: Sequence[BoolArray] | None = None,
) -> MachineFit:
    """The numbers `free` (P,) of the parameters, the others as drawn.

    considered : as of `fit_with_prior`.  outlier : of each recording the rows to leave out; None to find them.
    """
    count = len(parameters.names)
    result = PriorFit(np.zeros(count), np.ones(0), np.zeros((count, count)))
    out = [np.zeros(len(one.use), dtype=bool) for one in recordings] if outlier is None else list(outlier)
    blocks = sorted(set(parameters.block_of[free].tolist()))
    used = float(free.sum())
    for _ in range(_ROUNDS):
        theta = result.x * parameters.prior_std
        effects = parameters.split(theta, np.zeros((count, count)), blocks)
        now = [one.now(effects) for one in recordings]
        rows = [one.use & ~left for one, left in zip(now, out, strict=True)]
        # what the registration columns take is no error
        first = [
            _whitened(one, use, np.ones(one.residual_mm.shape[1]), result.x) for one, use in zip(now, rows, strict=True)
        ]
        sigmas = [_sigma_mm(one, use, _left(part, result.x, one), used / len(now)) for one, use, part in zip(now, rows, first, strict=True)]
        linear = [_whitened(one, use, sigma, result.x) for one, use, sigma in zip(now, rows, sigmas, strict=True)]
        new = fit_with_prior(normal_equations(linear), parameters.block_of, free, considered)
        change = float(np.abs(new.x - result.x).max(initial=0.0))
        result = new
        found = out
        if outlier is None:
            found = [
                one.poses.aligned.outliers(_left(part, result.x, one) / sigma, one.use)
                for one, part, sigma in zip(now, linear, sigmas, strict=True)
            ]
        same = all((a == b).all() for a, b in zip(found, out, strict=True))
        out = found
        if change < _SETTLED and same:
            break
    return MachineFit(parameters, tuple(now), tuple(linear), result, tuple(out), tuple(sigmas), free)


def _whitened(now: PosesNow, use: BoolArray, sigma_mm: FloatArray, x: FloatArray) -> Whitened:
    """The linear problem about the numbers x (P,), whose part z has."""
    place = np.flatnonzero(use)
    J = now.poses.columns_mm[use] / sigma_mm[:, None]
    R = now.registration_mm[use] / sigma_mm[:, None]
    z = now.residual_mm[use] / sigma_mm
    m = len(sigma_mm)
    J, R, z = J.reshape(-1, J.shape[2]), R.reshape(len(place) * m, -1), z.ravel()
    size = z - R @ np.linalg.lstsq(R, z, rcond=None)[0] if R.shape[1] else z
    huber = now.aligned.criteria.huber_sigmas
    root = np.sqrt(np.repeat(huber_weights(size.reshape(-1, m), huber=huber), m))
    return Whitened((z + J @ x) * root, J * root[:, None], R * root[:, None], np.repeat(place, m))


def _left(part: Whitened, x: FloatArray, now: PosesNow) -> FloatArray:
    """(N, m) mm of all rows, also those left out, with numbers x and the registration that goes with them; linear in
    what x changes."""
    registration = registration_of(part, x)
    return np.asarray(now.residual_mm - now.registration_mm @ registration)


def _sigma_mm(now: PosesNow, use: BoolArray, left_mm: FloatArray, numbers: float) -> FloatArray:
    """(m,) standard deviation of each measured coordinate, alike for all lengths and for all angles.

    The declared one, unless what is left contradicts it; else what is left, with the degrees of freedom that the fit
    has taken.
    """
    aligned = now.aligned
    values = left_mm[use]
    rows, m = values.shape
    dof = rows * m - numbers - now.registration_mm.shape[2]
    share = np.sqrt(rows * m / max(dof, 0.1 * rows * m))
    declared_mm = np.array(aligned.recording.reference_sigma_mm, dtype=np.float64)[: m - 3 * aligned.with_attitude]
    if aligned.of_links or aligned.of_distance:
        declared_mm = np.broadcast_to(declared_mm.mean(), m)
    reference = aligned.recording.reference
    angle_mm = np.nan if reference is None else reference.sigma_urad / UM_PER_MM
    sigma = np.empty(m)
    lengths = aligned.lengths
    sections = [(lengths, declared_mm)]
    if aligned.with_attitude:
        sections.append((slice(m - 3, m), np.full(3, angle_mm)))
    for part, stated in sections:
        seen = max(rms(trimmed_scale(values[:, part])) * share, MIN_SIGMA)
        own = values[:, part].size
        known = np.isfinite(stated).all() and (stated > 0).all()
        limit = np.sqrt(float(fdtri(max(own * dof / (rows * m), 1.0), 1e9, _CONTRADICTS)))
        sigma[part] = stated if known and seen <= limit * rms(stated) else seen
    return sigma
