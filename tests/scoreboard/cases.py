"""The cases of the scoreboard: in which family of machines and recordings, what is hidden, how large it is."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from compd.machine_kinds import KINDS
from compd.simulation.causes.catalogue import CAUSES, shuffle_causes

# Sizes of the tip's error in units of the reference's noise.
STRENGTHS = (0.5, 1.0, 2.0, 4.0)
WEAK_STRENGTHS = (0.5, 1.0)
# Range of sizes in the other families.
FLOORS = (2.0, 6.0)
# A change acts in a part of the rows only.
CHANGE_FLOORS = (4.0, 8.0)
# Causes that make nearly the same error within one workspace, a constant: any of them is a right name for any other.
CONSTANT_CAUSES = (
    "tool_offset",
    "link_zero",
    "base_joint_position",
    "platform_joint_position",
    "reference_registration",
)
# Causes that are made to begin or to grow in the middle of a recording.
CHANGING_CAUSES = ("tool_offset", "scale_gain", "joint_comparator_gain", "backlash")
# The thermometers without which a cause cannot be tested, as regular expressions of columns.
THERMOMETERS: Mapping[str, str] = {
    "link_expansion": r"temperature_link_\d+_degC",
    "link_expansion_lag": r"temperature_link_\d+_degC",
    "scale_expansion": r"temperature_link_\d+_degC",
    "platform_expansion": "temperature_platform_degC",
    "joint_comparator_drift": "temperature_platform_degC",
    "tool_expansion": "temperature_tool_degC",
    "frame_rod_expansion": "temperature_frame_degC",
    "plate_bending": r"temperature_plate_(top|bottom)_degC",
}
# The family of machines as `compd machine new` writes them, without comparators.
KINDS_FAMILY = "kinds"
# Causes outside the library that only a machine with rails or cranks can have.
OF_ACTUATORS = ("rail_direction", "crank_radius")


@dataclass(frozen=True)
class Case:
    """One machine with its campaigns. causes: ids; floors: the size of each one's error over the noise that is asked
    for; seed: of machine and days."""

    family: str
    causes: tuple[str, ...]
    floors: tuple[float, ...]
    seed: int

    @property
    def kind(self) -> str:
        """The kind of machine, of the family of kinds: one after the other as the seeds go."""
        return tuple(KINDS)[self.seed % len(KINDS)]

    @property
    def name(self) -> str:
        """Key in the file of results."""
        hidden = "+".join(f"{cause}x{size:.3g}" for cause, size in zip(self.causes, self.floors, strict=True))
        return f"{self.family}:{hidden or '-'}:{self.seed}"

    def rng(self, purpose: str) -> np.random.Generator:
        """Random numbers for one purpose of this case."""
        return np.random.default_rng([self.seed, zlib.crc32(f"{self.family}/{purpose}".encode())])


@dataclass(frozen=True)
class Family:
    """Cases of one kind.

    meaning : in a sentence. wanted : share of right cases that is wanted, %. draw : the number-th case with a seed.
    counts : cases of each set, by its name.
    """

    name: str
    meaning: str
    wanted: int
    draw: Callable[[int, int], Case]
    counts: Mapping[str, int]


def _library() -> list[str]:
    return [name for name, cause in CAUSES.items() if cause.in_library]


def _size(seed: int, least: float, most: float, count: int = 1) -> tuple[float, ...]:
    return tuple(np.round(np.random.default_rng(seed).uniform(least, most, count), 2).tolist())


def _swept(family: str, strengths: Sequence[float], among: Callable[[], list[str]]) -> Callable[[int, int], Case]:
    """Each cause once per round, with another one of the strengths in every round and in every set."""

    def draw(number: int, seed: int) -> Case:
        names = among()
        strength = strengths[(number + number // len(names) + seed // SEEDS_PER_SET) % len(strengths)]
        return Case(family, (names[number % len(names)],), (strength,), seed)

    return draw


def _random(
    family: str, among: Callable[[], Sequence[str]], count: int = 1, sizes: tuple[float, float] = FLOORS
) -> Callable[[int, int], Case]:
    """`count` causes at random."""

    def draw(number: int, seed: int) -> Case:
        return Case(family, tuple(shuffle_causes(among(), seed, family)[:count]), _size(seed, *sizes, count), seed)

    return draw


def _in_turn(family: str, causes: Sequence[str], sizes: tuple[float, float] = FLOORS) -> Callable[[int, int], Case]:
    """One cause after the other."""

    def draw(number: int, seed: int) -> Case:
        return Case(family, (causes[number % len(causes)],), _size(seed, *sizes), seed)

    return draw


def _nothing(family: str) -> Callable[[int, int], Case]:
    return lambda number, seed: Case(family, (), (), seed)


def _varying() -> list[str]:
    """Causes of the library whose error is not nearly constant."""
    return [name for name in _library() if name not in CONSTANT_CAUSES]


def _outside() -> list[str]:
    return [name for name, cause in CAUSES.items() if not cause.in_library and name not in OF_ACTUATORS]


def _on_every_machine() -> list[str]:
    return [name for name in _library() if name != "revolute_axis_tilt"]


def _without_comparators() -> list[str]:
    """Causes that every kind of machine has, with neither joint nor frame comparators."""
    return [
        name
        for name in _on_every_machine()
        if not CAUSES[name].acts_on_frame and not CAUSES[name].acts_on_joint_comparators
    ]


def _counts(prepared: int, full: int) -> dict[str, int]:
    return {"tuning": prepared, "test": prepared, "full": full}


# Sets and families have no seed in common.
SEEDS_PER_SET, SEEDS_PER_FAMILY = 1_000_000, 10_000
FIRST_SEED = {name: SEEDS_PER_SET * place for place, name in enumerate(("full", "tuning", "test"), start=1)}

FAMILIES: Mapping[str, Family] = {
    family.name: family
    for family in (
        Family(
            "library",
            "one effect of the library, 0.5 to 4 times the noise",
            97,
            _swept("library", STRENGTHS, _library),
            _counts(28, 560),
        ),
        Family("nothing", "nothing but two weak disturbances", 98, _nothing("nothing"), _counts(8, 100)),
        Family("outside", "a cause that the library does not have", 95, _random("outside", _outside), _counts(9, 60)),
        Family("pair", "two effects of the library", 90, _random("pair", _library, 2), _counts(10, 40)),
        Family("triple", "three effects of the library", 80, _random("triple", _library, 3), _counts(8, 40)),
        Family(
            "unregistered",
            "the instrument's frame is not that of the machine",
            97,
            _random("unregistered", _varying),
            _counts(8, 40),
        ),
        Family(
            "blind",
            "the thermometers that the cause needs are missing",
            95,
            _in_turn("blind", tuple(THERMOMETERS)),
            _counts(8, 40),
        ),
        Family("glints", "4 % gross rows and a run of 18", 97, _random("glints", _library), _counts(10, 40)),
        Family(
            "change",
            "an effect begins or grows in the middle of the recording",
            90,
            _in_turn("change", CHANGING_CAUSES, CHANGE_FLOORS),
            _counts(8, 40),
        ),
        Family("short", "90 rows without repeats", 90, _random("short", _library), _counts(8, 40)),
        Family(
            "hexapod",
            "another kind of machine",
            97,
            _random("hexapod", _on_every_machine, sizes=(1.0, 6.0)),
            _counts(10, 60),
        ),
        Family(
            "period",
            "a cyclic error whose period nobody has configured",
            90,
            _in_turn("period", ["scale_cyclic"]),
            _counts(6, 20),
        ),
        Family(
            "warm-start",
            "a lag, and sessions that begin warm",
            90,
            _in_turn("warm-start", ["link_expansion_lag"]),
            _counts(6, 20),
        ),
        Family(
            "weak",
            "one effect of the library, half the noise or as large",
            80,
            _swept("weak", WEAK_STRENGTHS, lambda: shuffle_causes(_library(), 0, "weak")),
            _counts(10, 56),
        ),
        Family(
            "distractors",
            "ten sensors that measure nothing of use",
            97,
            _random("distractors", _library, sizes=(1.0, 6.0)),
            _counts(8, 40),
        ),
        Family("shifted", "a constant on all rows besides", 95, _random("shifted", _varying), _counts(8, 40)),
        Family("drift", "noise that wanders, and no cause", 95, _nothing("drift"), _counts(8, 40)),
        Family(
            KINDS_FAMILY,
            "the eight kinds of machine, with scales and thermometers and no comparator",
            90,
            _random(KINDS_FAMILY, _without_comparators),
            _counts(16, 64),
        ),
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
