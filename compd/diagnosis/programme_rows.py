"""Rows that could be measured next, and what effects predict on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.model.effect import FittedEffect
from compd.model.observations import Observations


@dataclass(frozen=True, eq=False)
class ProgrammeRows:
    """R rows that could be measured next, in K programmes, each of which is measured as a whole.

    observations : the rows with perfect gauges; each programme is a session of its own.
    lengths : (K,) rows of each programme.
    to_set : (R,) what a person sets in each row, by column of the plan's file.
    """

    observations: Observations
    lengths: IntArray
    to_set: Sequence[Mapping[str, Any]]

    @property
    def ends(self) -> IntArray:
        """(K + 1,) where each programme begins and the last one ends."""
        return np.cumsum([0, *self.lengths])

    def rows_of(self, programme: int) -> Sequence[Mapping[str, Any]]:
        """What a person sets in the rows of one programme."""
        begin, end = self.ends[programme : programme + 2]
        return self.to_set[begin:end]


def columns_on(aligned: AlignedRecording, rows: Observations, effects: Sequence[FittedEffect]) -> list[FloatArray]:
    """(R, m, P) of each effect, mm per unit of each parameter, on R rows that were not measured."""
    planned = replace(aligned, rows=rows, measured_mm=_not_measured(aligned, rows), _by_port={})
    return [planned.columns(effect.effect, effect.constants) for effect in effects]


def nuisance_columns_on(aligned: AlignedRecording, rows: Observations) -> tuple[FloatArray, FloatArray]:
    """(N, m, Q) and (R, m, Q): columns that every fit contains, on the recording's rows and on R others.

    Of one motion of the instrument's frame, for which the rows have to be taken together.
    """
    count = len(aligned.rows)
    measured_mm = np.concatenate([aligned.measured_mm, _not_measured(aligned, rows)])
    both = replace(aligned, rows=aligned.rows.extended_by(rows), measured_mm=measured_mm, _by_port={})
    columns = both.registration_columns
    return columns[:count], columns[count:]


def _not_measured(aligned: AlignedRecording, rows: Observations) -> FloatArray:
    return np.full((len(rows), aligned.measured_mm.shape[1]), np.nan)
