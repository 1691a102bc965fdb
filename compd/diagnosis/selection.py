"""Is it enough? What an explanation must gain to be worth its words, and what it may leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from compd.arrays import FloatArray
from compd.model.effect import Effect

# In squares of the noise floor: what is below 0.45 of the floor is not worth a name. A machine always has
# disturbances of a fifth of the floor (0.04 each), and they may add up.
LEAST_GAIN = 0.2
# And so much of what is explained in all: no effect's form is true to better than a few per cent of its size. One
# that comes beside others must gain that times the root of how many numbers it brings: what a wrong form leaves is
# food for flexible effects.
LEAST_SHARE = 0.005
# For each number that is saved a simpler explanation may leave so much more, in squares of the floor: a flexible one
# also describes a part of the disturbances that a machine always has.
PER_NUMBER = 0.005
# A description fits anything a little: it must say more than an effect whose physics is known; and with the constant
# that it brings it does two things at once. An effect that contradicts what the sidecar declares must say more, too.
DESCRIPTION_COSTS = 2.5
CONTRADICTION_COSTS = 1.5
# At the floor: chance (the floor is known to 5 %, 600 rows give 3 %) and two disturbances of a fifth of it.
MOST_AT_FLOOR = 1.25
# What an explanation may leave of the error above the floor.
MOST_LEFT = 0.1
# A number is implausible when it is outside its range by more standard errors than this, and by more of the range;
# but where the range ends at zero, beyond it is the wrong sign: nothing shrinks when it gets warm.
SURE = 3.0
SLACK = 0.1


@dataclass(frozen=True)
class Number:
    """A fitted number as people read it."""

    name: str
    value: float
    std: float
    unit: str
    plausible: bool

    def as_json(self) -> dict[str, object]:
        """Keys of the verdict's `parameters`."""
        return {"name": self.name, "value": self.value, "std": self.std, "unit": self.unit, "plausible": self.plausible}


def cost(explained: float, factor: float = 1.0) -> float:
    """What an effect must gain, in squares of the floor, where so much is explained in all."""
    return factor * max(LEAST_GAIN, LEAST_SHARE * explained)


def at_floor(ratio: float, explained: float = 0.0) -> bool:
    """Whether nothing worth a name is left: of what is large, a hundredth of its square is form, not cause."""
    return ratio <= MOST_AT_FLOOR + LEAST_SHARE * max(explained, 0.0)


def explained_fraction(before: float, after: float) -> float:
    """phi = (SSE0 - SSE1) / (SSE0 - n sigma^2), from mean squares in squares of the floor; 0 where nothing is above.

    1 where more is explained than was above the floor: the floor is known to a few per cent only.
    """
    return min((before - after) / (before - 1.0), 1.0) if before > 1.0 else 0.0


def numbers(effect: Effect, links: int, theta: FloatArray, covariance: FloatArray) -> list[Number]:
    """An effect's numbers, each with its standard error and whether it is plausible."""
    found = []
    for k, column in enumerate(effect.columns(links)):
        std = float(np.sqrt(covariance[k, k])) if k < len(covariance) else float("nan")
        value, shown_std = column.parameter.from_theta(float(theta[k]), std)
        found.append(
            Number(
                column.name,
                value,
                shown_std,
                column.parameter.unit,
                plausible(column.parameter.theta_range, float(theta[k]), std),
            )
        )
    return found


def plausible(limits: tuple[float, float], theta: float, std: float) -> bool:
    """Whether a fitted number may be inside its range, within its error."""
    low, high = limits
    sure, slack = SURE * float(np.nan_to_num(std)), SLACK * (high - low)
    below, above = (sure if end == 0 else max(sure, slack) for end in (low, high))
    return bool(low - below <= theta <= high + above)


def untestable(limits: FloatArray, std: FloatArray) -> bool:
    """Whether none of an effect's numbers (P,) is known better than its range (P, 2) says already."""
    return bool((~(std < limits[:, 1] - limits[:, 0])).all())
