"""One row of a measurement that somebody has planned: where to, from which side, how fast, and what is held there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.motion import ACCELERATION_MM_PER_S2

# A link that has to come from the other side turns round so far before the row.
TURN_MM = 10.0
# A link that moves less than this on its way comes from nowhere: below it lie the plan's own digits.
STILL_MM = 0.005
# A pass is at its speed for so long before the row and after it.
STEADY_S = 0.3


@dataclass(frozen=True)
class PlannedRow:
    """A row at rest, or on the move where speed_mm_per_s > 0.

    number : from 1. point : the same for the same place, from 1. begins : a programme begins here.
    time_s : after the programme's first row. scale_mm : (n,).
    approach : (n,) +1, -1: the direction in which each link last moved; 0: as it comes.
    quantities : what is held, by name with unit; what is missing is left alone, but for a load: that is 0.
    """

    number: int
    purpose: str
    point: int
    begins: bool
    time_s: float
    scale_mm: FloatArray
    approach: FloatArray
    speed_mm_per_s: float
    quantities: Mapping[str, float] = field(default_factory=dict)

    @property
    def on_the_move(self) -> bool:
        return self.speed_mm_per_s > 0

    @property
    def parts_degC(self) -> dict[str, float]:
        """The machine's parts that are held at a temperature."""
        named = {name: value for name, value in self.quantities.items() if name.startswith("temperature_")}
        return {name: value for name, value in named.items() if name != "temperature_room_degC"}

    @property
    def turning_mm(self) -> FloatArray:
        """(n,) where the links turn round before the row; a pass starts there."""
        return self.scale_mm - self.approach * (self._run_up_mm if self.on_the_move else TURN_MM)

    @property
    def end_mm(self) -> FloatArray:
        """(n,) where the links stop: at the row, or as far behind it as a pass has started before it."""
        return self.scale_mm + self.approach * self._run_up_mm if self.on_the_move else self.scale_mm

    def way_mm(self, here_mm: FloatArray, direction: FloatArray) -> list[FloatArray]:
        """Scale values (n,) to go to in turn, from `here_mm`; a row on the move is passed after them.

        direction : (n,) in which each link moved last. The straight way is taken where it comes from the right side.
        """
        if self.on_the_move:
            return [self.turning_mm]
        moved = self.scale_mm - here_mm
        arriving = np.where(np.abs(moved) > STILL_MM, np.sign(moved), direction)
        straight = np.all((self.approach == 0) | (arriving == self.approach))
        return [self.scale_mm] if straight else [self.turning_mm, self.scale_mm]

    @property
    def _run_up_mm(self) -> float:
        speed = self.speed_mm_per_s
        return speed**2 / (2 * ACCELERATION_MM_PER_S2) + STEADY_S * speed
