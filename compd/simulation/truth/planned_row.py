"""One row of a planned measurement: place, direction of approach, speed, and held quantities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.motion import ACCELERATION_MM_PER_S2

# Distance before the row at which a link that has to arrive from the other side reverses.
TURN_MM = 10.0
# A link that moves less than this on its way keeps its direction: a plan's digits are no coarser.
STILL_MM = 0.005
# Time at constant speed before and after a row on the move.
STEADY_S = 0.3


@dataclass(frozen=True)
class PlannedRow:
    """A row at rest, or on the move where speed_mm_per_s > 0.

    number : from 1. point : number of its place, from 1. begins : the first row of a programme.
    time_s : after the programme's first row. scale_mm : (n,).
    approach : (n,) direction of each link's last motion, +1 or -1; 0: either.
    quantities : held values by name with unit. A missing quantity is not held; a missing load component is 0.
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
        """Held temperatures of the machine's parts, without the room's."""
        named = {name: value for name, value in self.quantities.items() if name.startswith("temperature_")}
        return {name: value for name, value in named.items() if name != "temperature_room_degC"}

    @property
    def turning_mm(self) -> FloatArray:
        """(n,) scale values at which the links reverse before the row, or from which they pass it."""
        return self.scale_mm - self.approach * (self._run_up_mm if self.on_the_move else TURN_MM)

    @property
    def end_mm(self) -> FloatArray:
        """(n,) scale values at which the links stop: the row, or as far behind it as a pass starts before it."""
        return self.scale_mm + self.approach * self._run_up_mm if self.on_the_move else self.scale_mm

    def way_mm(self, here_mm: FloatArray, direction: FloatArray) -> list[FloatArray]:
        """Scale values (n,) to go to in turn before the row is measured.

        here_mm : (n,) present scale values. direction : (n,) of each link's last motion. The straight way is taken
        where it approaches from the wanted side.
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
