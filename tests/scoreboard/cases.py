"""The cases of the scoreboard: every family, every set, and a case by its name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from compd.simulation.causes.catalogue import shuffle_causes
from tests.scoreboard import draws, hard_cases
from tests.scoreboard.case import (
    CHANGING_CAUSES,
    KINDS_FAMILY,
    SEEDS_PER_FAMILY,
    SEEDS_PER_SET,
    THERMOMETERS,
    Case,
    Family,
    counts,
)

FIRST_SEED = {name: SEEDS_PER_SET * place for place, name in enumerate(("full", "tuning", "test"), start=1)}

FAMILIES: Mapping[str, Family] = {
    family.name: family
    for family in (
        Family(
            "library",
            "one effect of the library, 0.5 to 4 times the noise",
            97,
            draws.swept("library", draws.STRENGTHS, draws.library),
            counts(28, 560),
        ),
        Family("nothing", "nothing but two weak disturbances", 98, draws.nothing("nothing"), counts(8, 100)),
        Family(
            "outside",
            "a cause that the library does not have",
            95,
            draws.any_of("outside", draws.outside),
            counts(9, 60),
        ),
        Family("pair", "two effects of the library", 90, draws.any_of("pair", draws.library, 2), counts(10, 40)),
        Family("triple", "three effects of the library", 80, draws.any_of("triple", draws.library, 3), counts(8, 40)),
        Family(
            "unregistered",
            "the instrument's frame is not that of the machine",
            97,
            draws.any_of("unregistered", draws.varying),
            counts(8, 40),
        ),
        Family(
            "blind",
            "the thermometers that the cause needs are missing",
            95,
            draws.in_turn("blind", tuple(THERMOMETERS)),
            counts(8, 40),
        ),
        Family("glints", "4 % gross rows and a run of 18", 97, draws.any_of("glints", draws.library), counts(10, 40)),
        Family(
            "change",
            "an effect begins or grows in the middle of the recording",
            90,
            draws.in_turn("change", CHANGING_CAUSES, draws.CHANGE_FLOORS),
            counts(8, 40),
        ),
        Family("short", "90 rows without repeats", 90, draws.any_of("short", draws.library), counts(8, 40)),
        Family(
            "hexapod",
            "another kind of machine",
            97,
            draws.any_of("hexapod", draws.on_every_machine, sizes=(1.0, 6.0)),
            counts(10, 60),
        ),
        Family(
            "period",
            "a cyclic error whose period nobody has configured",
            90,
            draws.in_turn("period", ["scale_cyclic"]),
            counts(6, 20),
        ),
        Family(
            "warm-start",
            "a lag, and sessions that begin warm",
            90,
            draws.in_turn("warm-start", ["link_expansion_lag"]),
            counts(6, 20),
        ),
        Family(
            "weak",
            "one effect of the library, half the noise or as large",
            80,
            draws.swept("weak", draws.WEAK_STRENGTHS, lambda: shuffle_causes(draws.library(), 0, "weak")),
            counts(10, 56),
        ),
        Family(
            "distractors",
            "ten sensors that measure nothing of use",
            97,
            draws.any_of("distractors", draws.library, sizes=(1.0, 6.0)),
            counts(8, 40),
        ),
        Family("shifted", "a constant on all rows besides", 95, draws.any_of("shifted", draws.varying), counts(8, 40)),
        Family("drift", "noise that wanders, and no cause", 95, draws.nothing("drift"), counts(8, 40)),
        Family(
            KINDS_FAMILY,
            "the eight kinds of machine, with scales and thermometers and no comparator",
            90,
            draws.any_of(KINDS_FAMILY, draws.without_comparators),
            counts(16, 64),
        ),
        *hard_cases.FAMILIES,
    )
}


def cases(names: Sequence[str], set_name: str) -> list[Case]:
    """The cases of a set, in an order in which the first part of a run contains some of every family."""
    places = {name: index for index, name in enumerate(FAMILIES)}
    groups = [
        [
            FAMILIES[name].draw(number, FIRST_SEED[set_name] + places[name] * SEEDS_PER_FAMILY + number)
            for number in range(FAMILIES[name].counts[set_name])
        ]
        for name in names
    ]
    return list(_evenly(groups))


def _evenly(groups: Sequence[Sequence[Case]]) -> Iterator[Case]:
    """Merge the groups, each spread evenly over the whole."""
    placed = [((number + 0.5) / len(group), case) for group in groups for number, case in enumerate(group)]
    return (case for _, case in sorted(placed, key=lambda pair: pair[0]))


def parse_case(text: str) -> Case:
    """A case from its name, as `Case.name` writes it. Raises ValueError for an unknown family."""
    family, hidden, seed = text.split(":")
    if family not in FAMILIES:
        raise ValueError(f"{text}: family is one of {', '.join(FAMILIES)}")
    parts = [] if hidden == "-" else [part.rpartition("x") for part in hidden.split("+")]
    return Case(family, tuple(part[0] for part in parts), tuple(float(part[2]) for part in parts), int(seed))
