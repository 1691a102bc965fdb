"""Rows that could be measured next, in programmes, and the machine at such rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison import AlignedRecording
from compd.model.effects import Observations

# Times after a step, as shares of the time for which it is watched.
WAITS = (0.0, 0.05, 0.15, 0.4, 1.0)
# The step itself takes a second: no instant, and short beside all that is watched.
STEP_S = 1.0
# Travel after a reversal: the distance over which an error builds up is not known, so from what a scale resolves to
# a hand's width.
REVERSALS_MM = (0.02, 0.1, 0.5, 2.0, 10.0, 30.0)


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


def programme_starts(lengths: IntArray) -> BoolArray:
    """(R,) whether a row is the first of its programme. lengths : (K,) rows of each."""
    starts = np.zeros(int(lengths.sum()), dtype=bool)
    starts[np.cumsum([0, *lengths])[:-1]] = True
    return starts


def step_times_s(watched_s: float) -> FloatArray:
    """Times of the rows of a step that is watched so long: one before it, then one for each of WAITS."""
    return np.array([0.0, *(STEP_S + watched_s * share for share in WAITS)])


def reversals_mm(most_mm: float) -> FloatArray:
    """A path about 0 that turns back after growing travels, of `most_mm` at most."""
    travels_mm = [travel for travel in REVERSALS_MM if travel <= most_mm]
    return np.array([0.0, *(sign * travel for travel in travels_mm for sign in (1.0, -1.0))])


def at_rows(aligned: AlignedRecording, rows: Observations) -> AlignedRecording:
    """The machine and the measured coordinates of a recording at other rows, where nothing was measured."""
    measured_mm = np.full((len(rows), len(aligned.labels)), np.nan)
    return replace(aligned, rows=rows, measured_mm=measured_mm, _by_port={})
