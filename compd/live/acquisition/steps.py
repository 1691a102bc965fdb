"""Steps of a length: a change from rest to rest without a reading in between.

A count that is lost looks so. A part that moves by 20 um takes 16 ms with 300 mm/s2, and many times that with the
acceleration that drives have for so short a way: of several such motions, readings show one on the way. Such a one
is a step as well, and says that the part is moved.
"""

from __future__ import annotations

from typing import NamedTuple

from compd.live.acquisition.possible_motion import GaugeSample

# A length is at rest if this many readings in a row, over this time (s), agree.
_FEWEST = 3
_STANDS_S = 0.05
# Largest interval (s) of readings for a step; in a longer one a reading on the way may be missing.
_MAX_GAP_S = 0.1


class Step(NamedTuple):
    """From one place at which a length stands to the next.

    height_mm : the later value minus the one before, mm. time_s : of the last reading before it, s.
    is_seen : whether readings show it on the way.
    """

    height_mm: float
    time_s: float
    is_seen: bool


class Steps:
    """Detects the steps of one length."""

    def __init__(self, least_mm: float, tolerance_mm: float) -> None:
        """`least_mm`: least size of a step; `tolerance_mm`: largest difference of agreeing readings."""
        self._least_mm = max(least_mm, tolerance_mm)
        self._tolerance_mm = tolerance_mm
        self._run: list[GaugeSample] = []  # the last readings, in agreement with each other
        self._stood: tuple[float, float] | None = None  # previous rest (mm), and its end (s)
        self._is_seen = False  # readings since then

    def note(self, sample: GaugeSample) -> Step | None:
        """Add a reading, in the order of time; return the step that it completes, if any."""
        run = self._run
        if run and abs(sample.value - run[0].value) > self._tolerance_mm:
            if _stands(run):
                self._stood, self._is_seen = (_middle(run), run[-1].time_s), False
            else:
                self._is_seen = True
            run.clear()
        run.append(sample)
        if self._stood is None or not _stands(run):
            del run[1:-_FEWEST]
            return None
        (stood_mm, until_s), self._stood = self._stood, None
        height_mm = _middle(run) - stood_mm
        unknown = not self._is_seen and run[0].time_s - until_s > _MAX_GAP_S
        return None if unknown or abs(height_mm) < self._least_mm else Step(height_mm, until_s, self._is_seen)


def _stands(samples: list[GaugeSample]) -> bool:
    return len(samples) >= _FEWEST and samples[-1].time_s - samples[0].time_s >= _STANDS_S


def _middle(samples: list[GaugeSample]) -> float:
    last = sorted(sample.value for sample in samples[-_FEWEST:])
    return last[len(last) // 2]
