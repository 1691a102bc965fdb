"""How the cases of a family are drawn: which causes, and how large."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from compd.simulation.causes.catalogue import CAUSES, shuffle_causes
from tests.scoreboard.case import CONSTANT_CAUSES, SEEDS_PER_SET, Case

# Sizes of the tip's error in units of the reference's noise.
STRENGTHS = (0.5, 1.0, 2.0, 4.0)
WEAK_STRENGTHS = (0.5, 1.0)
# Range of sizes in the other families.
FLOORS = (2.0, 6.0)
# A change acts in a part of the rows only.
CHANGE_FLOORS = (4.0, 8.0)
# Causes outside the library that only a machine with rails or cranks can have.
OF_ACTUATORS = ("rail_direction", "crank_radius")


def library() -> list[str]:
    return [name for name, cause in CAUSES.items() if cause.in_library]


def size(seed: int, least: float, most: float, count: int = 1) -> tuple[float, ...]:
    return tuple(np.round(np.random.default_rng(seed).uniform(least, most, count), 2).tolist())


def swept(family: str, strengths: Sequence[float], among: Callable[[], list[str]]) -> Callable[[int, int], Case]:
    """Each cause once per round, with another one of the strengths in every round and in every set."""

    def draw(number: int, seed: int) -> Case:
        names = among()
        strength = strengths[(number + number // len(names) + seed // SEEDS_PER_SET) % len(strengths)]
        return Case(family, (names[number % len(names)],), (strength,), seed)

    return draw


def any_of(
    family: str, among: Callable[[], Sequence[str]], count: int = 1, sizes: tuple[float, float] = FLOORS
) -> Callable[[int, int], Case]:
    """`count` causes at random."""

    def draw(number: int, seed: int) -> Case:
        return Case(family, tuple(shuffle_causes(among(), seed, family)[:count]), size(seed, *sizes, count), seed)

    return draw


def in_turn(family: str, causes: Sequence[str], sizes: tuple[float, float] = FLOORS) -> Callable[[int, int], Case]:
    """One cause after the other."""

    def draw(number: int, seed: int) -> Case:
        return Case(family, (causes[number % len(causes)],), size(seed, *sizes), seed)

    return draw


def nothing(family: str) -> Callable[[int, int], Case]:
    return lambda number, seed: Case(family, (), (), seed)


def varying() -> list[str]:
    """Causes of the library whose error is not nearly constant."""
    return [name for name in library() if name not in CONSTANT_CAUSES]


def outside() -> list[str]:
    return [name for name, cause in CAUSES.items() if not cause.in_library and name not in OF_ACTUATORS]


def on_every_machine() -> list[str]:
    return [name for name in library() if name != "revolute_axis_tilt"]


def without_comparators() -> list[str]:
    """Causes that every kind of machine has, with neither joint nor frame comparators."""
    return [
        name
        for name in on_every_machine()
        if not CAUSES[name].acts_on_frame and not CAUSES[name].acts_on_joint_comparators
    ]
