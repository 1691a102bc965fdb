"""The numbers of a machine fitted to several recordings: robust Gauss-Newton on the forward model, with the prior.

In each round every instrument is registered again to the prediction so far (`aligned_with`), the noise of lengths and
of angles is taken from what is left, rows with an error that no noise explains are left out, and the linear problem of
`prior_fit` gives the next numbers. The derivatives are those of the machine with the numbers so far.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtri

from compd.arrays import BoolArray, FloatArray, rms
from compd.calibration.block_sets import BlockSets
from compd.calibration.criteria import CalibrationCriteria
from compd.calibration.gross_poses import PoseRows, gross_poses
from compd.calibration.parameters import Parameters
from compd.calibration.poses import MeasuredPoses, PosesNow, links_of_pose
from compd.calibration.prior_fit import Normal, PriorFit, Whitened, fit_with_prior, normal_equations
from compd.statistics import MIN_SIGMA, huber_weights, robust_regression, trimmed_scale
from compd.units import UM_PER_MM

# The forward model is nearly linear: three rounds settle numbers and outliers, the others are for large errors.
_ROUNDS = 12
# A change of the numbers, in tolerances, that ends the rounds.
_SETTLED = 1e-4
# Gross poses are sought from this change on, in tolerances, or from this round on, which gross poses may keep from
# settling: derivatives far from the result make good poses gross.
_NEAR, _LATE = 0.05, 4
# Share of the measured values that count as degrees of freedom where a fit has nearly as many numbers.
_FEWEST_SHARE = 0.1
# Rounds in which the weights of lengths and angles settle.
_WEIGHT_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class MachineFit:
    """Numbers fitted to K recordings.

    now : (K) what is left of each.  linear : (K) the linear problem about the result, in which z has what the numbers
    explain.  result : numbers and covariance in tolerances.  outlier : (K) of (N,).  sigma_mm : (K) of (m,).
    sets : of blocks, over which the numbers are averaged; None where all that are free are fitted.
    """

    parameters: Parameters
    now: tuple[PosesNow, ...]
    linear: tuple[Whitened, ...]
    result: PriorFit
    outlier: tuple[BoolArray, ...]
    sigma_mm: tuple[FloatArray, ...]
    free: BoolArray
    sets: BlockSets | None = None

    @property
    def theta(self) -> FloatArray:
        """(P,) in the effects' units."""
        return self.result.x * self.parameters.prior_std

    @property
    def covariance(self) -> FloatArray:
        """(P, P) of theta."""
        prior = self.parameters.prior_std
        return np.asarray(self.result.C * np.outer(prior, prior))

    def about(self, joint: PriorFit) -> MachineFit:
        """The same numbers, their covariance the mean square of their errors by another fit of the same poses."""
        off = joint.x - self.result.x
        return replace(self, result=self.result._replace(C=joint.C + np.outer(off, off)))

    @property
    def normal(self) -> Normal:
        """The linear problem of all numbers."""
        return normal_equations(self.linear)


def fit_machine(
    recordings: Sequence[MeasuredPoses],
    parameters: Parameters,
    free: BoolArray,
    sets: BlockSets | None = None,
    outlier: Sequence[BoolArray] | None = None,
    start: MachineFit | None = None,
) -> MachineFit:
    """The numbers `free` (P,) of the parameters, the others as drawn.

    sets : to average over.  outlier : of each recording the rows to leave out; None to find them.
    start : a fit of the same recordings, whose numbers to begin with and whose noise to keep.
    """
    count = len(parameters.names)
    result = PriorFit(np.zeros(count), np.ones(0), np.zeros((count, count))) if start is None else start.result
    out = [np.zeros(len(one.use), dtype=bool) for one in recordings] if outlier is None else list(outlier)
    blocks = sorted(set(parameters.block_of[free].tolist()))
    numbers = float(free.sum()) / len(recordings)
    sigmas = [] if start is None else list(start.sigma_mm)
    x = result.x
    for turn in range(_ROUNDS):
        x, now = _reaching(recordings, parameters, blocks, result.x, x, out)
        result = result._replace(x=x)
        rows = [one.use & ~left for one, left in zip(now, out, strict=True)]
        if start is None:
            sigmas = [_sigma_mm(one, use, numbers) for one, use in zip(now, rows, strict=True)]
        linear = [_whitened(one, use, sigma, result.x) for one, use, sigma in zip(now, rows, sigmas, strict=True)]
        normal = normal_equations(linear)
        new = fit_with_prior(normal, parameters.block_of, free) if sets is None else sets.averaged(normal)
        change = float(np.abs(new.x - result.x).max(initial=0.0))
        result = new
        found = out
        if outlier is None and (change < _NEAR or turn >= _LATE):
            found = unexplained_poses(now, sigmas, result.x, parameters, free, sets)
        same = all((a == b).all() for a, b in zip(found, out, strict=True))
        out = found
        if change < _SETTLED and same:
            break
    return MachineFit(parameters, tuple(now), tuple(linear), result, tuple(out), tuple(sigmas), free, sets)


def _reaching(
    recordings: Sequence[MeasuredPoses],
    parameters: Parameters,
    blocks: list[int],
    x: FloatArray,
    before: FloatArray,
    left_out: Sequence[BoolArray],
) -> tuple[FloatArray, list[PosesNow]]:
    """The numbers x (P,) in tolerances and the poses with them; halfway back to those before as long as a machine with
    such numbers has no pose in most of the rows: the step was too long for derivatives."""
    none = np.zeros((len(x), len(x)))
    while True:
        fitted = parameters.split(x * parameters.prior_std, none, blocks)
        now = [one.now(fitted, out) for one, out in zip(recordings, left_out, strict=True)]
        most = all(2 * own.use.sum() >= one.use.sum() for own, one in zip(now, recordings, strict=True))
        if most or np.abs(x - before).max(initial=0.0) < _SETTLED:
            return x, now
        x = (x + before) / 2


def unexplained_poses(
    now: Sequence[PosesNow],
    sigmas: Sequence[FloatArray],
    x: FloatArray,
    parameters: Parameters,
    free: BoolArray,
    sets: BlockSets | None = None,
) -> list[BoolArray]:
    """(N,) gross poses of each recording, which no repeat of the same visit confirms.

    They come from the linear problem about the numbers x (P,), in which those `free` (P,) are fitted.
    sigmas : (w,) noise of each recording.  sets : as of `fit_machine`.
    """
    block_of = parameters.block_of[free]

    def precision(normal: Normal) -> FloatArray:
        own = fit_with_prior(normal, block_of, np.ones(len(block_of), dtype=bool)) if sets is None else sets
        return np.diag(1 / own.scale[block_of] ** 2)

    gross = gross_poses([_pose_rows(*one, x, free) for one in zip(now, sigmas, strict=True)], precision)
    return [_unconfirmed(*one) for one in zip(now, sigmas, gross, strict=True)]


def _pose_rows(now: PosesNow, sigma_mm: FloatArray, x: FloatArray, free: BoolArray) -> PoseRows:
    residual_mm, registration_mm, columns_mm = now.weighed
    sections = _sections(now, len(sigma_mm))
    stated = declared_mm(now, len(sigma_mm)) / sigma_mm
    J = columns_mm / sigma_mm[:, None]
    return PoseRows(
        residual_mm / sigma_mm + J @ x,
        J[:, :, free],
        registration_mm / sigma_mm[:, None],
        now.use,
        tuple(sections),
        np.array([rms(stated[part]) for part in sections]),
    )


def _unconfirmed(now: PosesNow, sigma_mm: FloatArray, gross: BoolArray) -> BoolArray:
    left = registered_mm(now, now.use & ~gross, sigma_mm)[0] / sigma_mm
    return now.poses.aligned.unconfirmed(gross, left, now.use)


def registered_mm(now: PosesNow, use: BoolArray, sigma_mm: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """(N, w) and (N, m) mm, in weighed and in measured coordinates, what is left beside the registration of rows `use`.

    sigma_mm : (w,); None for lengths and angles by what is left of each.
    """
    residual_mm, R_mm, _ = now.weighed
    r = np.zeros(R_mm.shape[2])
    sigma = np.ones(residual_mm.shape[1]) if sigma_mm is None else sigma_mm
    # urad and um have no size in common: each counts in the scatter that the registration leaves
    for _ in range(_WEIGHT_ROUNDS if sigma_mm is None and R_mm.shape[2] and len(_sections(now, len(sigma))) > 1 else 1):
        if sigma_mm is None:
            sigma = scatter_mm(now, (residual_mm - R_mm @ r)[use])
        if R_mm.shape[2]:
            r = robust_regression(
                R_mm[use] / sigma[:, None], residual_mm[use] / sigma, huber=now.aligned.criteria.huber_sigmas
            )
    return residual_mm - R_mm @ r, now.residual_mm - now.registration_mm @ r


def whitened_poses(now: PosesNow, use: BoolArray, sigma_mm: FloatArray) -> Whitened:
    """What is left of rows `use` (N,) in standard deviations sigma_mm (w,), beside columns of numbers and
    registration."""
    return _whitened(now, use, sigma_mm, np.zeros(now.columns_mm.shape[2]))


def _whitened(now: PosesNow, use: BoolArray, sigma_mm: FloatArray, x: FloatArray) -> Whitened:
    """The linear problem about the numbers x (P,), whose part z has."""
    place, w = np.flatnonzero(use), len(sigma_mm)
    residual_mm, registration_mm, columns_mm = now.weighed
    left = registered_mm(now, use, sigma_mm)[0][use] / sigma_mm
    root = np.sqrt(huber_weights(left, huber=now.aligned.criteria.huber_sigmas))[:, None]
    z = residual_mm[use] / sigma_mm * root
    J = columns_mm[use] / sigma_mm[:, None] * root[:, :, None]
    R = registration_mm[use] / sigma_mm[:, None] * root[:, :, None]
    J = J.reshape(len(place) * w, -1)
    return Whitened(z.ravel() + J @ x, J, R.reshape(len(place) * w, -1), np.repeat(place, w))


def _sections(now: PosesNow, width: int) -> list[slice]:
    """The weighed coordinates that have one scatter: lengths, then angles."""
    if now.poses.to_links is None and now.aligned.with_attitude:
        return [slice(width - 3), slice(width - 3, width)]
    return [slice(width)]


def scatter_mm(now: PosesNow, left_mm: FloatArray) -> FloatArray:
    """(w,) scatter of what is left (R, w), alike for all coordinates of a section."""
    sigma = np.empty(left_mm.shape[1])
    for part in _sections(now, len(sigma)):
        sigma[part] = max(rms(trimmed_scale(left_mm[:, part])), MIN_SIGMA)
    return sigma


def _sigma_mm(now: PosesNow, use: BoolArray, numbers: float) -> FloatArray:
    """(w,) standard deviation of each weighed coordinate.

    The declared one, unless what is left contradicts it; else what is left, with the degrees of freedom that the fit
    has taken.
    """
    left_mm = registered_mm(now, use)[0][use]
    values = left_mm.size
    dof = max(values - numbers - now.registration_mm.shape[2], _FEWEST_SHARE * values)
    sigma: FloatArray = scatter_mm(now, left_mm) * np.sqrt(values / dof)
    declared = declared_mm(now, len(sigma))
    for part in _sections(now, len(sigma)):
        stated = declared[part]
        own = left_mm[:, part].size * dof / values
        if np.isfinite(stated).all() and rms(sigma[part]) <= np.sqrt(
            float(fdtri(own, 1e9, CalibrationCriteria.contradicts))
        ) * rms(stated):
            sigma[part] = stated
    return sigma


def declared_mm(now: PosesNow, width: int) -> FloatArray:
    """(w,) declared standard uncertainty of the reference; nan where nobody declared it, or links are weighed."""
    aligned, reference = now.aligned, now.aligned.recording.reference
    if now.poses.to_links is not None or reference is None:
        return np.full(width, np.nan)
    declared = np.array(aligned.recording.reference_sigma_mm, dtype=np.float64)
    if aligned.with_attitude:
        declared = np.append(declared, np.full(3, reference.sigma_urad / UM_PER_MM))
    declared = np.broadcast_to(declared, width) if declared.size == 1 else declared
    return np.where(declared > 0, declared, np.nan) if len(declared) == width else np.full(width, np.nan)


def in_likelier_coordinates(fit: MachineFit) -> list[MeasuredPoses]:
    """Each recording of poses weighed as measured, or as errors of links, whichever makes what is left likelier.

    Where the instrument is the noisiest part its coordinates have one scatter each; where the machine is, its links
    have. The likelihoods are those of normal errors, each beside a fit that is weighed so. Lengths and angles have a
    scatter each, links one: a scatter costs half the logarithm of the number of values (Schwarz, Ann. Statist. 6 (1978)
    461).
    """
    as_links = [_as_links(now) for now in fit.now]
    if all(one is None for one in as_links):
        return [now.poses for now in fit.now]
    poses = [now.poses if one is None else one for now, one in zip(fit.now, as_links, strict=True)]
    other = fit_machine(poses, fit.parameters, fit.free)
    chosen = []
    for k, one in enumerate(as_links):
        by_links = one is not None and _log_likelihood(other, k) > _log_likelihood(fit, k)
        chosen.append(poses[k] if by_links else fit.now[k].poses)
    return chosen


def _as_links(now: PosesNow) -> MeasuredPoses | None:
    """The recording weighed as errors of links; None where a pose does not tell them, or its noise is declared."""
    to_links = links_of_pose(now.poses.aligned)
    if to_links is None or to_links.shape[1] != to_links.shape[2] or np.isfinite(declared_mm(now, 6)).any():
        return None
    return replace(now.poses, to_links=to_links)


def _log_likelihood(fit: MachineFit, k: int) -> float:
    """Of what the fit leaves of recording k as measured, less the price of its scatters, but for a constant."""
    now, outlier = fit.now[k], fit.outlier[k]
    use = now.use & ~outlier
    sigma = scatter_mm(now, registered_mm(now, use)[0][use])
    # density of the pose = density of the links times the determinant
    links = now.poses.to_links
    turned = 0.0 if links is None else float(np.linalg.slogdet(links[use])[1].sum())
    price = len(_sections(now, len(sigma))) * np.log(use.sum() * len(sigma)) / 2
    return turned - float(use.sum() * np.log(sigma).sum() + price)
