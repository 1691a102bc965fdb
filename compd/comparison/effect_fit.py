"""Fitting effects: robust Gauss-Newton on the forward model, jointly with the effects that the model has already.

The prediction f(theta) is nearly linear in the parameters theta of all effects and in the nuisance terms r, which are
the instrument's frame and the unknown states at the start of each session (`compd.comparison.nuisance`). Each step
solves the weighted linear problem

    minimise  sum_i w_i | (y_i - f_i(theta) - R_i r - G_i (d_theta, d_r)) / sigma |^2

by `solve_least_squares`, with Huber weights w_i (`huber_weights`), and then evaluates the full model f again. The
derivatives G (R are its last columns) are taken once, at each row's readings without any effect. Outliers are found
from the residual, left out, and the fit is repeated until they no longer change. Standard errors are those of the
weighted problem: `cluster_covariance`.

Example::

    model = [initial_effect(load_library()["link_expansion"], {}, links=3)]
    result = fit(align_recording(recording, configuration), model)
    result.fitted[0].theta          # (1,) in the unit of fit
    np.sqrt(result.covariance)      # (1, 1) its standard error
    result.rms_um                   # what is left, per coordinate
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray, rms
from compd.comparison.alignment.aligned_recording import AlignedRecording, effect_deltas
from compd.comparison.neighbour_block import neighbour_blocks
from compd.comparison.nuisance import nuisance_beside
from compd.comparison.outliers import outlier_rows
from compd.errors import CompdError
from compd.model.effects import ConstantValues, Effect, FittedEffect, Observations, needed_quantities
from compd.statistics import cluster_covariance, huber_weights, solve_least_squares
from compd.units import UM_PER_MM

# Lowest and highest value of each quantity, by its name.
Ranges: TypeAlias = Mapping[str, tuple[float, float]]


def quantity_ranges(fitted: Sequence[FittedEffect], rows: Observations, used: BoolArray) -> Ranges:
    """Of each quantity that the effects read, in the rows `used` (N,); without those that have no value there."""
    ranges: dict[str, tuple[float, float]] = {}
    for effect in fitted:
        for name in needed_quantities(effect.effect, rows.links):
            values = rows.quantities[name][used] if name in rows.quantities else np.array([])
            if np.isfinite(values).any():
                ranges[name] = float(np.nanmin(values)), float(np.nanmax(values))
    return ranges


_LOOK_AT_FORMULA = (
    "look at its formula: exp of a large number, a root or logarithm of a negative one, or a division by 0 has no value"
)
# The prediction is linear in what effects add to within 1e-5: two steps do, a tenth would mean a defect.
STEPS = 10
# Rounds of finding outliers: they settle in two or three.
ROUNDS = 8
# A step that changes the prediction by less than this share of the residual ends the iteration.
CONVERGED = 1e-6
# um; below this a residual is rounding.
MIN_RMS_UM = 1e-9


@dataclass(frozen=True, eq=False)
class FitResult:
    """Effects with their parameters, fitted together on one recording of N rows with m coordinates.

    fitted : in the order given, each with its own covariance.
    names : (P,) "link_elasticity.k" ..., the parameters of all effects.
    covariance : (P, P) of these parameters, jointly; nan where the data do not determine a parameter.
    residual_um : (N, m), nan where a row cannot be used.
    used : (N,) rows that the fit rests on.
    outlier : (N,) rows with a residual that no noise explains, left out of the fit.
    clusters : number of independent blocks that the standard errors rest on.
    ranges : of each quantity that the effects read, in the rows that the parameters rest on.
    """

    fitted: tuple[FittedEffect, ...]
    names: tuple[str, ...]
    covariance: FloatArray
    residual_um: FloatArray
    used: BoolArray
    outlier: BoolArray
    clusters: int
    ranges: Ranges

    @property
    def rms_um(self) -> float:
        """Root mean square residual per coordinate, over the rows used."""
        return rms(self.residual_um[self.used])


def initial_effect(effect: Effect, shape: ConstantValues, links: int) -> FittedEffect:
    """The effect with all parameters 0 and an unknown covariance: where a fit begins."""
    count = len(effect.columns(links))
    return FittedEffect(effect, np.zeros(count), shape, np.full((count, count), np.nan))


def fit(
    aligned: AlignedRecording,
    effects: Sequence[FittedEffect],
    weight_sigma_um: FloatArray | None = None,
    outlier: BoolArray | None = None,
) -> FitResult:
    """Fit the effects together, and with them the nuisance terms: the instrument's frame, initial states of lags.

    effects : with the parameters to start from; nonlinear constants stay as they are.
    weight_sigma_um : (m,) standard deviation of each coordinate's noise; all alike if None.
    outlier : (N,) rows to leave out, and no others; None to find them.

    Raises CompdError where an effect needs what the recording has not, or where fewer values are usable than there
    are parameters.
    """
    sigma_um = np.ones(len(aligned.labels)) if weight_sigma_um is None else weight_sigma_um
    usable = aligned.usable.mask
    initial = tuple(effects)
    effect_deltas(initial, aligned.rows)  # raises where an effect needs what the recording has not
    columns_um = [aligned.columns(effect.effect, effect.constants) * UM_PER_MM for effect in initial]
    ends = np.cumsum([0, *(column.shape[2] for column in columns_um)])
    own_um = np.concatenate([np.zeros((*aligned.measured_mm.shape, 0)), *columns_um], axis=2)
    usable = usable & np.isfinite(own_um).all(axis=(1, 2)) & np.isfinite(aligned.registration_columns).all(axis=(1, 2))
    if outlier is not None:
        usable = usable & ~outlier
    G_um = np.concatenate([own_um, nuisance_beside(aligned, initial, own_um, usable)], axis=2)
    without_value = {
        effect.effect.id: int((aligned.usable.mask & ~np.isfinite(column).all(axis=(1, 2))).sum())
        for effect, column in zip(initial, columns_um, strict=True)
    }
    _check_rows(aligned, usable, G_um.shape[2], without_value)

    theta = np.concatenate([np.zeros(0), *(effect.theta for effect in initial)])
    nuisance = np.zeros(G_um.shape[2] - len(theta))
    left_out = np.zeros(len(usable), dtype=bool)
    earlier: set[bytes] = set()
    for _ in range(ROUNDS):
        theta, nuisance, residual_um = _gauss_newton(
            aligned, initial, ends, G_um, theta, nuisance, usable & ~left_out, sigma_um
        )
        if outlier is not None:
            break
        visit, conditions = aligned.recording.visit, aligned.conditions
        found = outlier_rows(residual_um / sigma_um, usable, visit, aligned.criteria, conditions)
        # a set of outliers that comes back would alternate for ever
        if (found == left_out).all() or found.tobytes() in earlier:
            break
        earlier.add(left_out.tobytes())
        left_out = found
    residual_um[~usable] = np.nan
    used = usable & ~left_out
    block = neighbour_blocks(aligned.recording, aligned.criteria.blocks)[used]
    whitened = residual_um[used] / sigma_um
    root_weight = np.sqrt(huber_weights(whitened, huber=aligned.criteria.huber_sigmas))[:, None]
    G = G_um[used] / sigma_um[:, None] * root_weight[:, :, None]
    whole = cluster_covariance(G, whitened * root_weight, block)
    covariance = whole[: len(theta), : len(theta)]
    return FitResult(
        fitted=tuple(
            replace(effect, theta=theta[a:b], covariance=covariance[a:b, a:b])
            for effect, a, b in zip(initial, ends[:-1], ends[1:], strict=True)
        ),
        names=tuple(
            f"{effect.effect.id}.{column.name}"
            for effect in initial
            for column in effect.effect.columns(aligned.rows.links)
        ),
        covariance=covariance,
        residual_um=residual_um,
        used=used,
        outlier=left_out if outlier is None else outlier,
        clusters=len(np.unique(block)),
        ranges=quantity_ranges(initial, aligned.rows, used),
    )


def _check_rows(
    aligned: AlignedRecording, usable: BoolArray, parameters: int, without_value: Mapping[str, int]
) -> None:
    """without_value : by effect, on how many rows, which are usable but for that, it is not a finite number."""
    measured = int(usable.sum()) * len(aligned.labels)
    if measured <= parameters:
        lacking = [f"{name} has no finite value in {rows} of them" for name, rows in without_value.items() if rows]
        raise CompdError.of(
            str(aligned.recording.path),
            f"{measured} measured values for {parameters} numbers to fit",
            value="; ".join([f"{int(usable.sum())} rows of {aligned.recording.rows} are usable", *lacking]),
            allowed="more values than numbers",
            next_step=_LOOK_AT_FORMULA if lacking else "`compd recording check` says which rows are left out",
        )


def _gauss_newton(
    aligned: AlignedRecording,
    initial: Sequence[FittedEffect],
    ends: IntArray,
    G_um: FloatArray,
    theta: FloatArray,
    nuisance: FloatArray,
    use: BoolArray,
    sigma_um: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Parameters (P,), nuisance terms (Q,) and residual in um (N, m) after convergence on the rows `use`.

    ends : (E + 1,) where each effect's parameters begin in theta.  G_um : (N, m, P + Q).
    """
    P = len(theta)
    G = (G_um[use] / sigma_um[:, None]).reshape(use.sum() * len(sigma_um), G_um.shape[2])
    for _ in range(STEPS):
        effects = [replace(effect, theta=theta[a:b]) for effect, a, b in zip(initial, ends[:-1], ends[1:], strict=True)]
        _, total = effect_deltas(effects, aligned.rows)
        residual_um = (aligned.measured_mm - aligned.predicted_mm(total)) * UM_PER_MM - G_um[:, :, P:] @ nuisance
        whitened = residual_um[use] / sigma_um
        weights = np.repeat(huber_weights(whitened, huber=aligned.criteria.huber_sigmas), len(sigma_um))
        step = solve_least_squares(G, whitened.ravel(), weights)
        theta, nuisance = theta + step[:P], nuisance + step[P:]
        change_um = rms(G_um[use] @ step)
        if change_um <= CONVERGED * max(rms(residual_um[use]), MIN_RMS_UM):
            break
    return theta, nuisance, residual_um
