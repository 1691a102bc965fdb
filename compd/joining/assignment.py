"""Assignment of each point of an instrument to a dwell of the machine, or the reason why it is ambiguous."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.joining.distances import separation_mm

# Largest distance (mm) of repeats at one place, unless the uncertainty is larger: six standard deviations of a laser
# tracker's 8 um at a few metres. Also the least distance at which a point no longer belongs to a dwell.
REPEAT_MM = 0.05
# Largest distance of a point from its dwell, in rms of the others.
LIMIT_SIGMAS = 6.0
# Another assignment competes if it lacks no more dwells of points than are allowed, and if fewer than this share of its
# pairs are the same; it must then be worse by the factor CLEARLY_WORSE, as clock offsets must.
OTHER_SHARE = 0.9
CLEARLY_WORSE = 2.0
# Share of the points, or one, that may be without a dwell.
MAX_WITHOUT = 0.05


@dataclass(frozen=True)
class Assignment:
    """The dwell of each of G points."""

    dwell: IntArray  #: (G,) number of the dwell from 0, -1 for none
    rms_mm: float  #: of what the distances between the points differ by
    limit_mm: float  #: points farther from their dwell than this have none
    other: IntArray  #: (G,) the dwell that each point fits next best, -1 for none
    unclear: BoolArray  #: (G,) points that would fit another dwell as well; they have none in what a search returns
    #: (by how many dwells all points are shifted, rms in mm), None if there is no other
    next_best: tuple[int, float] | None = None

    @property
    def count(self) -> int:
        """Points with a dwell."""
        return int((self.dwell >= 0).sum())


@dataclass(frozen=True)
class NoAssignment:
    """The reason why there is none."""

    why: str  #: as the `what` of a problem
    value: str = ""  #: value, allowed: likewise
    allowed: str = ""
    #: point, dwell: the first point that does not fit, and the dwell where it would be in order; None where not known
    point: int | None = None
    dwell: int | None = None


def on_one_line(measured_mm: FloatArray) -> NoAssignment:
    """The problem of points (G, d) on one line; a single point far from all others makes a line, too."""
    away_mm = np.linalg.norm(measured_mm - np.median(measured_mm, axis=0), axis=1)
    far = int(np.argmax(away_mm))
    return NoAssignment(
        "the points are on one line, or one of them is far from all others",
        f"{away_mm[far]:.6g} mm from their middle, the median is {np.median(away_mm):.6g} mm",
        "three or more that are not on one line",
        far,
        0,
    )


def repeat_distance_mm(sigma_mm: float) -> float:
    """Points nearer to each other are at one place: six standard deviations of the difference of two, REPEAT_MM or
    more."""
    return REPEAT_MM if np.isnan(sigma_mm) else max(REPEAT_MM, LIMIT_SIGMAS * np.sqrt(2.0) * sigma_mm)


def unit_hint(place: FloatArray, point: FloatArray) -> str:
    """A remark if the ratio of the instrument's steps to the machine's is that of two units."""
    steps = [float(np.median(np.abs(separation_mm(values[:-1], values[1:])))) for values in (place, point)]
    ratio = steps[1] / max(steps[0], 1e-9)
    for factor, mistake in ((25.4, "mm read as inches"), (1 / 25.4, "inches read as mm"), (1000.0, "mm read as m")):
        if abs(ratio / factor - 1.0) < 0.1:
            return f"; its steps are {ratio:.3g} times the machine's: {mistake}?"
    if abs(ratio * 1000.0 - 1.0) < 0.1:
        return f"; its steps are {ratio:.3g} times the machine's: m read as mm?"
    return ""
