"""A case of the scoreboard, a family of cases, and what is known of the causes that they hide."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from compd.machine_kinds import KINDS

# Sets and families have no seed in common.
SEEDS_PER_SET, SEEDS_PER_FAMILY = 1_000_000, 10_000
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


def counts(prepared: int, full: int) -> dict[str, int]:
    """Cases of each set; those of two of them are also prepared to be looked at again and again."""
    return {"tuning": prepared, "test": prepared, "full": full}
