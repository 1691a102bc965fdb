"""Steps of a length: it stands, then stands elsewhere, and no reading shows it on the way.

A count that is lost looks so. A part that moves by 20 um takes 16 ms with 300 mm/s2, and many times that with the
acceleration that drives have for so short a way: of several such motions, readings show one on the way.
"""

from __future__ import annotations

from typing import NamedTuple

from compd.live.acquisition.possible_motion import GaugeSample

# It stands where so many readings in a row, over so long (s), agree.
_FEWEST = 3
_STANDS_S = 0.05
# Where readings are further apart, s, one on the way may just be missing.
_LONGEST_GAP_S = 0.1


class Step(NamedTuple):
    """height_mm : the last value minus the one before, mm. time_s : of the last reading before it, s."""

    height_mm: float
    time_s: float


class Steps:
    """Of one length."""

    def __init__(self, least_mm: float, tolerance_mm: float) -> None:
        """`least_mm`: of a step that counts; `tolerance_mm`: readings that differ by no more agree."""
        self._least_mm = max(least_mm, tolerance_mm)
        self._tolerance_mm = tolerance_mm
        self._before: list[GaugeSample] = []  # readings that agree, until the last one that did not
        self._now: list[GaugeSample] = []  # readings since then, which agree with each other

    def note(self, sample: GaugeSample) -> Step | None:
        """A reading, in the order of time; the step that it completes, where it completes one."""
        if self._now and abs(sample.value - self._now[0].value) > self._tolerance_mm:
            self._before, self._now = self._now, []
        self._now.append(sample)
        if not _stands(self._now):
            return None
        before, self._before = self._before, []
        del self._now[1:-_FEWEST]
        if not _stands(before) or self._now[0].time_s - before[-1].time_s > _LONGEST_GAP_S:
            return None
        height_mm = _middle(self._now) - _middle(before)
        return Step(height_mm, before[-1].time_s) if abs(height_mm) >= self._least_mm else None


def _stands(samples: list[GaugeSample]) -> bool:
    return len(samples) >= _FEWEST and samples[-1].time_s - samples[0].time_s >= _STANDS_S


def _middle(samples: list[GaugeSample]) -> float:
    last = sorted(sample.value for sample in samples[-_FEWEST:])
    return last[_FEWEST // 2]
