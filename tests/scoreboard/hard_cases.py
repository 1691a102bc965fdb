"""Families of recordings as they come from workshops, in which an honest analysis says less than it might."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tests.scoreboard import draws
from tests.scoreboard.case import THERMOMETERS, Case, Family, counts
from tests.scoreboard.external_gantry import BED
from tests.scoreboard.external_machine import ExternalMachine
from tests.scoreboard.external_printer import PRINTER
from tests.scoreboard.external_stage import STAGE

ONE_WARM_UP, ROUNDED, PLACE_BY_PLACE, WRONG_NOISE = "one-warm-up", "rounded", "place-by-place", "wrong-noise"
PLANE, RE_MOUNTED, MANY_SMALL, ZERO_ELSEWHERE = "plane", "re-mounted", "many-small", "zero-elsewhere"
# Causes that depend on the place alone, so that a machine that is measured place by place shows them.
OF_THE_PLACE = ("scale_gain", "joint_runout", "link_sag", "joint_comparator_gain", "scale_cyclic")
# Causes that raise or lower the tip by much of what they do.
ACROSS_A_PLANE = ("link_expansion", "platform_expansion", "link_sag", "scale_gain", "link_elasticity", "backlash")
# A cause of each kind that a change of zero concerns, and others that it does not.
SINCE_ZERO = (*THERMOMETERS, "reference_air_index", "scale_gain", "link_elasticity", "backlash")
SMALL, SMALL_FLOORS = 6, (0.5, 1.2)
# Beside steps and fewer coordinates an effect has to be larger.
LARGE_FLOORS = (3.0, 9.0)
# One case in so many hides nothing.
NOTHING_IN = 4


def _without_constants_and_time() -> list[str]:
    """Causes that are neither a constant nor what a target that is mounted elsewhere does."""
    return [name for name in draws.varying() if name not in ("reference_drift", "revolute_axis_tilt")]


def _or_nothing(draw: Callable[[int, int], Case]) -> Callable[[int, int], Case]:
    """Of NOTHING_IN cases one without a cause."""

    def drawn(number: int, seed: int) -> Case:
        case = draw(number, seed)
        return case if number % NOTHING_IN else Case(case.family, (), (), seed)

    return drawn


def _with_external(
    family: str, machine: ExternalMachine, ours: Callable[[int, int], Case], sizes: tuple[float, float] = LARGE_FLOORS
) -> Callable[[int, int], Case]:
    """In turn a machine that compd knows and one that it does not."""

    def draw(number: int, seed: int) -> Case:
        if number % 2:
            return ours(number // 2, seed)
        return external(number // 2, seed)

    external = draws.in_turn(family, machine.causes, sizes)
    return draw


def _in_turn(family: str, causes: Sequence[str]) -> Callable[[int, int], Case]:
    return draws.in_turn(family, causes, LARGE_FLOORS)


FAMILIES = (
    Family(
        ONE_WARM_UP,
        "one session in which everything warms up, and a thermal cause",
        90,
        _with_external(ONE_WARM_UP, PRINTER, _in_turn(ONE_WARM_UP, tuple(THERMOMETERS))),
        counts(8, 40),
    ),
    Family(
        ROUNDED,
        "values in steps: the tripod's reference, and a stage whose repeats are mostly equal",
        90,
        _with_external(ROUNDED, STAGE, draws.any_of(ROUNDED, draws.varying, sizes=LARGE_FLOORS)),
        counts(8, 40),
    ),
    Family(
        PLACE_BY_PLACE,
        "one height after the other, so that time goes with place",
        90,
        draws.in_turn(PLACE_BY_PLACE, OF_THE_PLACE),
        counts(8, 40),
    ),
    Family(
        WRONG_NOISE,
        "the noise is declared five or ten times too large or too small",
        90,
        _or_nothing(draws.any_of(WRONG_NOISE, draws.varying)),
        counts(8, 40),
    ),
    Family(
        PLANE,
        "a plane is touched: the reference is a constant",
        90,
        _with_external(PLANE, BED, _in_turn(PLANE, ACROSS_A_PLANE)),
        counts(8, 40),
    ),
    Family(
        RE_MOUNTED,
        "between two sessions the target is taken off and put on again",
        90,
        draws.any_of(RE_MOUNTED, _without_constants_and_time),
        counts(8, 40),
    ),
    Family(
        MANY_SMALL,
        f"{SMALL} effects, each 0.5 to 1.2 times the noise",
        80,
        draws.any_of(MANY_SMALL, draws.library, SMALL, SMALL_FLOORS),
        counts(8, 40),
    ),
    Family(
        ZERO_ELSEWHERE,
        "machine zero was taken 5 to 12 K warmer or colder, and in half of the cases nobody says how warm",
        90,
        draws.in_turn(ZERO_ELSEWHERE, SINCE_ZERO),
        counts(8, 40),
    ),
)
