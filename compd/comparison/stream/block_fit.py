"""Fitting effects on a recording of any length: the steps of `compd.comparison.effect_fit` as passes through all rows.

A fit on the sample is where it starts. It also fixes what Huber's weights count in, and beyond which residual a row is
an outlier. Each pass adds up the normal equations of a Gauss-Newton step over all rows, and of each cluster for the
standard errors. The sample knows the scale of the weights within 0.5 %, which moves no parameter by more than a
hundredth of its standard error; where the sample has all rows, the result is that of `fit`.

Standard errors rest on blocks of neighbouring rows: those of `compd.comparison.neighbour_block`, but that a visit is
looked for in neighbouring parts alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.alignment.aligned_recording import AlignedRecording, effect_deltas
from compd.comparison.effect_fit import CONVERGED, MIN_RMS_UM, STEPS, FitResult
from compd.comparison.initial_states import initial_states
from compd.comparison.nuisance import nuisance_columns
from compd.comparison.outliers import OutlierLimits, outlier_limits
from compd.comparison.quantity_ranges import Ranges, joined_ranges, quantity_ranges
from compd.comparison.stream.block_queue import HandOver, computed_blocks
from compd.comparison.stream.carried_effects import (
    NOTHING_CARRIED,
    CarriedState,
    EffectRows,
    StateKey,
    advance_effects,
)
from compd.comparison.stream.fixed_terms import session_places
from compd.comparison.stream.normal_equations import ClusterNormals
from compd.comparison.stream.recording_stream import Block, RecordingStream, align_block
from compd.comparison.stream.sample import Sample
from compd.model import sum_deltas
from compd.model.effects import FittedEffect
from compd.recording import BLOCKS as FOLDS
from compd.recording import Recording
from compd.statistics import huber_weights, robust_sigma, solve_least_squares
from compd.units import UM_PER_MM


class RowClusters:
    """Numbers the clusters of parts of a recording, given in their order."""

    def __init__(self, sample: Sample) -> None:
        rows, blocks = sample.rows, sample.aligned.criteria.blocks
        if sample.aligned.recording.session is not None:
            self._lengths = dict(sorted(sample.rows_of_session.items()))
        else:
            # fold k has the rows i with i * FOLDS // rows = k
            ends = [-(-k * rows // FOLDS) for k in range(FOLDS + 1)]
            self._lengths = {k: end - begin for k, (begin, end) in enumerate(pairwise(ends)) if end > begin}
        self._place = {number: k for k, number in enumerate(self._lengths)}
        self._of_sessions = len(self._lengths) >= blocks
        self._per_session = 1 if self._of_sessions else -(-blocks // len(self._lengths))
        self._rows_before: Counter[int] = Counter()
        self._rows = rows
        self._row = 0
        self._visits: dict[int, int] = {}

    def number(self, part: Recording) -> IntArray:
        """(N,) cluster of each row of the next part."""
        count = part.rows
        index = self._row + np.arange(count)
        self._row += count
        session = index * FOLDS // self._rows if part.session is None else part.session
        cluster = np.zeros(count, dtype=np.int64)
        for number in np.unique(session).tolist():
            rows = np.flatnonzero(session == number)
            within = self._rows_before[number] + np.arange(len(rows))
            place = self._place[number] * self._per_session
            cluster[rows] = place + within * self._per_session // self._lengths[number]
            self._rows_before[number] += len(rows)
        return cluster if self._of_sessions else self._with_visits(cluster, part.visit)

    def _with_visits(self, cluster: IntArray, visit: IntArray | None) -> IntArray:
        """A visit that goes over into the next cluster stays in its first one."""
        if visit is None:
            return cluster
        visits, first, inverse = np.unique(visit, return_index=True, return_inverse=True)
        begun = cluster[first]
        for k in np.flatnonzero(np.isin(visits, list(self._visits))):
            begun[k] = self._visits[int(visits[k])]
        together = begun[inverse]
        self._visits = dict(zip(visits.tolist(), begun.tolist(), strict=True))
        # a visit as long as a cluster would take all of it
        stays = (visit >= 0) & (cluster - together == 1)
        return np.where(stays, together, cluster)


def fit_blocks(
    stream: RecordingStream,
    sample: Sample,
    start: FitResult,
    weight_sigma_um: FloatArray,
    progress: Callable[[int], None] = lambda rows: None,
) -> FitResult:
    """Fit the effects of a fit on the sample to all rows; nonlinear constants stay as they are.

    sample : of the stream.  start : the fit on it.  weight_sigma_um : (m,) that it was weighed by.
    progress : called with the number of rows of a pass that are done, after each block; there are two to five passes.

    Parameters, covariance, clusters and ranges of the result are of all rows, its residual and the rows used of the
    sample.
    Raises RecordingError with the problems of the recording.
    """
    system = _system(sample, start, weight_sigma_um)
    theta = np.concatenate([np.zeros(0), *(effect.theta for effect in start.fitted)])
    nuisance = system.start_nuisance
    for _ in range(STEPS):
        normals, ranges = _normals(stream, sample, system, start.fitted, theta, nuisance, progress)
        step, change = normals.step(len(theta))
        theta, nuisance = theta + step[: len(theta)], nuisance + step[len(theta) :]
        if change <= CONVERGED * max(np.sqrt(normals.squares / normals.values), MIN_RMS_UM):
            break
    covariance = normals.covariance(len(theta))
    ends = np.cumsum([0, *(len(effect.theta) for effect in start.fitted)])
    return replace(
        start,
        fitted=tuple(
            replace(effect, theta=theta[a:b], covariance=covariance[a:b, a:b])
            for effect, a, b in zip(start.fitted, ends[:-1], ends[1:], strict=True)
        ),
        covariance=covariance,
        clusters=normals.clusters,
        ranges=ranges,
    )


@dataclass(frozen=True)
class _System:
    """What the sample fixes.

    sigma_um : (m,) weights.  limits, scale : of whitened residuals, the scale (m,) of Huber's weights.
    keys : unknown states of each effect.  start_nuisance : (Q,) of the instrument's frame, then of each effect and
    session the states of `keys`.
    """

    sigma_um: FloatArray
    limits: OutlierLimits
    scale: FloatArray
    keys: dict[str, Sequence[StateKey]]
    start_nuisance: FloatArray


def _system(sample: Sample, start: FitResult, sigma_um: FloatArray) -> _System:
    aligned = sample.aligned
    whitened = start.residual_um / sigma_um
    known: BoolArray = np.asarray(np.isfinite(whitened).all(axis=1))
    limits = outlier_limits(whitened, known, aligned.recording.visit, aligned.criteria, aligned.conditions)
    columns_um = nuisance_columns(aligned, start.fitted)
    _, total = effect_deltas(start.fitted, aligned.rows)
    taken_um = (aligned.measured_mm - aligned.predicted_mm(total)) * UM_PER_MM - start.residual_um
    flat_um = taken_um[known].ravel()
    amounts = solve_least_squares(columns_um[known].reshape(len(flat_um), columns_um.shape[2]), flat_um)
    count = aligned.registration_columns.shape[2]
    nuisance: list[FloatArray] = [amounts[:count]]
    amounts = amounts[count:]
    sampled = session_places(sample.starts_s, aligned.recording.time_s[aligned.rows.session_start])
    keys: dict[str, Sequence[StateKey]] = {}
    for effect in start.fitted:
        states = initial_states(aligned.rows, effect.effect, effect.constants)
        if not states:
            continue
        own = keys[effect.effect.id] = sorted({state.key for state in states})
        values = np.zeros((len(sample.starts_s), len(own)))
        for state, amount in zip(states, amounts, strict=False):
            values[sampled[state.session], own.index(state.key)] = amount
        nuisance.append(values.ravel())
        amounts = amounts[len(states) :]
    return _System(sigma_um, limits, robust_sigma(whitened[start.used]), keys, np.concatenate(nuisance))


def _normals(
    stream: RecordingStream,
    sample: Sample,
    system: _System,
    fitted: Sequence[FittedEffect],
    theta: FloatArray,
    nuisance: FloatArray,
    progress: Callable[[int], None],
) -> tuple[ClusterNormals, Ranges]:
    """The normal equations at these parameters, over all rows, and the ranges of the quantities in those used."""
    ends = np.cumsum([0, *(len(effect.theta) for effect in fitted)])
    effects = [replace(effect, theta=theta[a:b]) for effect, a, b in zip(fitted, ends[:-1], ends[1:], strict=True)]
    clusters = RowClusters(sample)

    def numbered() -> Iterator[tuple[Block, IntArray]]:
        for block in stream.blocks():
            yield block, clusters.number(block.recording.select(block.own))

    def compute(
        numbered_block: tuple[Block, IntArray], hand_over: HandOver[CarriedState]
    ) -> tuple[ClusterNormals, Ranges, int]:
        block, cluster = numbered_block
        aligned = align_block(block, sample.aligned)
        rows, carried = advance_effects(effects, aligned.rows, system.keys, hand_over.take())
        hand_over.give(carried)
        session = session_places(sample.starts_s, aligned.recording.time_s)
        normals, used = _block_normals(aligned, effects, rows, system, nuisance, cluster, session)
        return normals, quantity_ranges(effects, aligned.rows, used), aligned.recording.rows

    totals, done = ClusterNormals(), 0
    ranges: Ranges = {}
    for normals, of_block, rows in computed_blocks(numbered(), compute, NOTHING_CARRIED):
        totals.add(normals)
        ranges = joined_ranges(ranges, of_block)
        done += rows
        progress(done)
    return totals, ranges


def _block_normals(
    aligned: AlignedRecording,
    fitted: Sequence[FittedEffect],
    effects: EffectRows,
    system: _System,
    nuisance: FloatArray,
    cluster: IntArray,
    session: IntArray,
) -> tuple[ClusterNormals, BoolArray]:
    """The normal equations of a block, and the rows (N,) that they are of.

    cluster, session : (N,) of each row, the session by its place.
    """
    own_um = [aligned.propagated(effect.effect, effects.bases[effect.effect.id]) * UM_PER_MM for effect in fitted]
    nuisance_um = [aligned.registration_columns * UM_PER_MM]
    sessions = (len(system.start_nuisance) - nuisance_um[0].shape[2]) // max(sum(map(len, system.keys.values())), 1)
    at_session = (session[:, None] == np.arange(sessions)).astype(np.float64)
    for effect in fitted:
        if effect.effect.id in system.keys:
            states_um = aligned.propagated(effect.effect, effects.states[effect.effect.id]) * UM_PER_MM
            each = states_um[:, :, None, :] * at_session[:, None, :, None]
            nuisance_um.append(each.reshape(*states_um.shape[:2], -1))
    R_um = np.concatenate(nuisance_um, axis=2)
    G_um = np.concatenate([*own_um, R_um], axis=2)
    predicted_mm = aligned.predicted_mm(sum_deltas(list(effects.deltas(fitted, aligned.rows).values())))
    residual_um = (aligned.measured_mm - predicted_mm) * UM_PER_MM - R_um @ nuisance
    usable = aligned.usable.mask & np.isfinite(G_um).all(axis=(1, 2)) & np.isfinite(residual_um).all(axis=1)
    whitened = residual_um / system.sigma_um
    used = usable & ~system.limits.outliers(whitened, usable, aligned.recording.visit)
    weight = huber_weights(whitened[used], scale=lambda _: system.scale, huber=aligned.criteria.huber_sigmas)
    normals = ClusterNormals()
    normals.add_rows(G_um[used] / system.sigma_um[:, None], whitened[used], weight, cluster[used])
    return normals, used
