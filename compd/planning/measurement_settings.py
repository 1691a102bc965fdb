"""What a person can set on a machine of an external model: columns of the recording, within limits.

Nothing is known of such a machine but its recording. So each column may be set to any value within the limits that it
kept there, or that a person gives, whatever the others are; a column that always followed another one exactly goes on
following it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from compd.arrays import FloatArray
from compd.errors import CompdError

# Column -> lowest and highest value that it may be set to.
SettingLimits: TypeAlias = Mapping[str, tuple[float, float]]

# A column with so few values, each taken twice on average, is set in steps, such as the stops of a stage.
MAX_STEPS = 12
DIRECTIONS = (-1.0, 0.0, 1.0)
# Combinations of settings that are tried. Values of a continuous setting among them: three show a curve, and 33 are
# steps of 3 % of its range.
MAX_COMBINATIONS = 512
MIN_LEVELS, MAX_LEVELS = 3, 33
# Two columns that a straight line joins to within this share of their range were never set apart.
TIED = 1e-3
# A setting is rounded to 1e-4 of its range: finer than matters, and short enough to type.
DIGITS_OF_RANGE = 4


class Follower(NamedTuple):
    """A column that was `offset` + `slope` times another one in every row."""

    name: str
    slope: float
    offset: float


@dataclass(frozen=True, eq=False)
class Setting:
    """A column that a person sets.

    values : (L,) what it may be set to, rising.  followers : columns that follow it.
    """

    name: str
    values: FloatArray
    followers: Sequence[Follower] = ()

    @property
    def middle(self) -> float:
        """The value in the middle; of an even number the higher one."""
        return float(self.values[len(self.values) // 2])

    @property
    def is_direction(self) -> bool:
        """Whether it is the sign of a motion: nothing that can be left at a value."""
        return _are_directions(self.values)

    def columns(self, values: FloatArray) -> dict[str, FloatArray]:
        """The columns (r,) of the setting and its followers where it has these values (r,)."""
        followers = {follower.name: follower.offset + follower.slope * values for follower in self.followers}
        return {self.name: values, **followers}


def settings_of(recorded: Mapping[str, FloatArray], limits: SettingLimits) -> list[Setting]:
    """The settings by which a person varies some columns of a recording; a column that never changed is none.

    recorded : name -> (n,) values, nan where a cell is empty.
    limits : by column, where they are not the lowest and the highest of these values.
    Raises CompdError where limits leave a direction no value.
    """
    leaders: dict[str, list[Follower]] = {}
    for name in sorted(recorded, key=lambda name: name not in limits):
        tied = [(other, _follower(name, recorded[name], recorded[other])) for other in leaders]
        leader, follower = next((pair for pair in tied if pair[1] is not None), (name, None))
        if follower is None or name in limits:
            leaders[name] = []
        else:
            leaders[leader].append(follower)
    steps = {name: _steps(name, recorded[name], limits.get(name)) for name in leaders}
    continuous = [name for name in leaders if not len(steps[name])]
    combinations = math.prod(len(values) for values in steps.values() if len(values))
    levels = (MAX_COMBINATIONS / combinations) ** (1 / max(len(continuous), 1))
    count = int(np.clip(levels, MIN_LEVELS, MAX_LEVELS))
    values = steps | {name: _levels(*_range(recorded[name], limits.get(name)), count) for name in continuous}
    return [
        Setting(name, values[name], followers)
        for name, followers in leaders.items()
        if len(values[name]) > 1 or name in limits
    ]


def _follower(name: str, values: FloatArray, leader: FloatArray) -> Follower | None:
    """The column (n,) as a follower of another one (n,); None where the two were set apart."""
    known = np.isfinite(values) & np.isfinite(leader)
    x, y = leader[known], values[known]
    if not len(x) or not np.ptp(x) or not np.ptp(y):
        return None
    dx = x - x.mean()
    slope = float(dx @ y / (dx @ dx))
    offset = float(y.mean() - slope * x.mean())
    is_tied = np.abs(y - offset - slope * x).max() <= TIED * np.ptp(y)
    return Follower(name, slope, offset) if is_tied else None


def _steps(name: str, values: FloatArray, limits: tuple[float, float] | None) -> FloatArray:
    """The few values that a column takes, within its limits, and the limits; none of a column that takes many."""
    known = values[np.isfinite(values)]
    steps = np.unique(known)
    if len(steps) > 1 and (len(steps) > MAX_STEPS or 2 * len(steps) > len(known)):
        return np.zeros(0)
    if limits is None:
        return steps
    if not _are_directions(steps):
        steps = np.union1d(steps, limits)
    within = steps[(limits[0] <= steps) & (steps <= limits[1])]
    if not len(within):
        raise CompdError.of(
            f"limit of {name}",
            "leaves no value",
            value=f"{limits[0]:g} to {limits[1]:g}",
            allowed=", ".join(f"{step:g}" for step in steps),
            next_step="widen it, or leave it out",
        )
    return np.asarray(within)


def _are_directions(values: FloatArray) -> bool:
    return bool(np.isin(values, DIRECTIONS).all()) and bool((values != 0).any())


def _range(values: FloatArray, limits: tuple[float, float] | None) -> tuple[float, float]:
    return (float(np.nanmin(values)), float(np.nanmax(values))) if limits is None else limits


def _levels(low: float, high: float, count: int) -> FloatArray:
    """(count,) values from low to high in equal steps, rounded; the ends inwards."""
    if low == high:
        return np.array([low])
    decimals = DIGITS_OF_RANGE - math.ceil(math.log10(high - low))
    digit = 10.0**-decimals
    ends = math.ceil(low / digit) * digit, math.floor(high / digit) * digit
    return np.round(np.linspace(*ends, count), decimals)
