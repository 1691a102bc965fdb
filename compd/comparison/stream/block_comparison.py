"""Comparing a long recording block by block with a model, by what a sample of it has fixed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.comparison.comparison import NO_QUANTITY
from compd.comparison.contributions import deltas_without
from compd.comparison.recording_comparison import compare
from compd.comparison.stream.block_queue import HandOver, computed_blocks
from compd.comparison.stream.carried_effects import NOTHING_CARRIED, CarriedState, advance_effects
from compd.comparison.stream.fixed_terms import NOTHING, BlockNuisance, FixedTerms, fixed_terms
from compd.comparison.stream.recording_stream import Block, RecordingStream, align_block
from compd.comparison.stream.residual_totals import BlockResiduals, ContributionSquares, ResidualTotals
from compd.comparison.stream.sample import Sample
from compd.comparison.stream.streamed_comparison import StreamedComparison
from compd.comparison.stream.time_envelope import TimeEnvelope
from compd.model import Deltas, sum_deltas
from compd.model.effects import FittedEffect
from compd.units import UM_PER_MM


def compare_blocks(
    stream: RecordingStream,
    sample: Sample,
    fitted: Sequence[FittedEffect] = (),
    covariance: FloatArray | None = None,
    progress: Callable[[int], None] = lambda rows: None,
) -> StreamedComparison:
    """Compare a recording of any length with the model and its effects, as `compare` does one in memory.

    sample : of the stream.  progress : called with the number of rows that are done, after each block.  Others as of
    `compare`.
    Raises CompdError and RecordingError as `compare` does.
    """
    comparison = compare(sample.aligned, fitted, covariance)
    fixed = fixed_terms(comparison, sample.starts_s)
    coordinates = len(sample.aligned.labels)
    totals = ResidualTotals(coordinates, TimeEnvelope(sample.begin_s, sample.end_s, coordinates))

    def compute(block: Block, hand_over: HandOver[CarriedState]) -> BlockResiduals:
        aligned = align_block(block, sample.aligned)
        effects, carried = advance_effects(fitted, aligned.rows, fixed.keys, hand_over.take())
        hand_over.give(carried)
        nuisance = fixed.block_nuisance(aligned, fitted, effects)
        return _block_residuals(aligned, effects.deltas(fitted, aligned.rows), nuisance, fixed)

    for residuals in computed_blocks(stream.blocks(), compute, NOTHING_CARRIED):
        totals.add(residuals)
        progress(totals.rows)
    return StreamedComparison.of_sample(comparison, totals)


def _block_residuals(
    aligned: AlignedRecording, by_effect: Mapping[str, Deltas], nuisance: BlockNuisance, fixed: FixedTerms
) -> BlockResiduals:
    """What the block adds to the totals."""
    recording = aligned.recording
    predicted_mm = aligned.predicted_mm(sum_deltas(list(by_effect.values())))
    usable = aligned.usable.without(np.asarray(~np.isfinite(predicted_mm).all(axis=1)), NO_QUANTITY)
    known = usable.mask
    terms = fixed.terms[NOTHING]
    registration_um = nuisance.registration_um @ terms.registration
    residual_um = (aligned.measured_mm - predicted_mm) * UM_PER_MM - terms.explained_um(nuisance)
    outlier = fixed.limits.outliers(residual_um, known, recording.visit)
    used = known & ~outlier
    contributions: dict[str, ContributionSquares] = {}
    for name, added in deltas_without(aligned, by_effect).items():
        without_mm = aligned.predicted_mm(added)
        rows = used & np.isfinite(without_mm).all(axis=1)
        without_um = (aligned.measured_mm - without_mm) * UM_PER_MM - fixed.terms[name].explained_um(nuisance)
        moved_um = (predicted_mm - without_mm)[rows][:, aligned.lengths] * UM_PER_MM
        without_um = without_um[rows][:, aligned.lengths]
        contributions[name] = ContributionSquares(
            float((moved_um**2).sum()), float((without_um**2).sum()), moved_um.size
        )
    used_um = residual_um[used]
    return BlockResiduals(
        rows=recording.rows,
        row=recording.row[used],
        time_s=recording.time_s[used],
        residual_um=used_um,
        distance_um=_distance_um(aligned, used_um),
        registration_um=registration_um[used].sum(axis=0),
        outlier_row=recording.row[outlier],
        left_out=usable.left_out,
        contributions=contributions,
    )


def _distance_um(aligned: AlignedRecording, residual_um: FloatArray) -> FloatArray:
    """(U,) as `Comparison.distance_um`."""
    if aligned.of_links:
        return np.asarray(np.abs(residual_um).max(axis=1, initial=0.0))
    return np.asarray(np.linalg.norm(residual_um[:, aligned.lengths], axis=1))
