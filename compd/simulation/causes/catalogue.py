"""Which causes there are, how one is asked for, and how one is hidden under seal."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.errors import CompdError, Problem
from compd.files import write_files
from compd.simulation.causes import gauges, joints, link, outside_library, reference, scale
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.mechanism import Mechanism

CAUSES: Mapping[str, type[Cause]] = {
    cause.id: cause for module in (scale, gauges, link, joints, reference, outside_library) for cause in module.CAUSES
}
# A hidden effect is one to six times the reference's noise: from barely seen to plain.
LEAST_FLOORS = 1.0
MOST_FLOORS = 6.0
# One hidden cause in five is none of the library's.
OUTSIDE_SHARE = 0.2


class HiddenCause(NamedTuple):
    """One cause by name. strength: in its unit; None = so strong that the tip's error is `floors` times the noise."""

    id: str
    strength: float | None
    floors: float = 3.0


def asked(texts: Sequence[str]) -> list[HiddenCause]:
    """From `id=strength`, or `id` alone for three times the noise. Raises CompdError with everything that is wrong."""
    found, problems = [], []
    for text in texts:
        name, given, number = text.partition("=")
        try:
            strength = float(number) if given else None
        except ValueError:
            strength = float("nan")
        if name not in CAUSES:
            problems.append(Problem(where="--effect", what="no such cause", value=name, allowed=", ".join(CAUSES)))
        elif strength is not None and (not np.isfinite(strength) or strength == 0):
            problems.append(
                Problem(
                    where=f"--effect {name}",
                    what="is no strength",
                    value=number,
                    allowed=f"a number in {CAUSES[name].unit}",
                )
            )
        elif strength is not None and CAUSES[name].reciprocal:
            strength = 1 / strength
        found.append(HiddenCause(name, strength))
    if problems:
        raise CompdError(problems)
    return found


def drawn(seed: int, mechanism: Mechanism) -> HiddenCause:
    """Cause and size that follow from the seed: nobody needs to know which."""
    rng = np.random.default_rng([seed, 0x5EA1])
    outside = rng.uniform() < OUTSIDE_SHARE
    names = [name for name in possible(mechanism) if CAUSES[name].in_library != outside]
    return HiddenCause(str(rng.choice(names)), None, float(rng.uniform(LEAST_FLOORS, MOST_FLOORS)))


def possible(mechanism: Mechanism) -> list[str]:
    """The causes that this machine can have."""
    without = set() if len(mechanism.axes_P) else {"revolute_axis_tilt"}
    return [name for name in CAUSES if name not in without]


def build(name: str, strength: float, mechanism: Mechanism, seed: int) -> Cause:
    """The cause with its parts; the same seed gives the same parts at every strength."""
    number = list(CAUSES).index(name)
    return CAUSES[name](strength, mechanism, np.random.default_rng([seed, number]))


def seal(path: Path, causes: Sequence[Cause], floors: Sequence[float], weak: Sequence[Cause], seed: int) -> None:
    """NAME.answer.json, for a scorer: what was hidden, how strong, how large it made the tip's error."""
    answer = {
        "case": path.name.removesuffix(".answer.json"),
        "seed": seed,
        "effects": {cause.id: _plain(cause) for cause in causes},
        "answers": [cause.id for cause in causes if cause.in_library],
        "follows": [name for cause in causes for name in cause.follows],
        "kind": _kind(causes),
        "units": {cause.id: cause.unit for cause in causes},
        "error_in_floors": {cause.id: round(f, 3) for cause, f in zip(causes, floors, strict=True)},
        "weak_disturbances": {cause.id: _plain(cause) for cause in weak},
    }
    write_files({path: json.dumps(answer, indent=1) + "\n"})


def _plain(cause: Cause) -> float | list[float]:
    values = [float(f"{value:.6g}") for value in cause.values]
    return values[0] if len(values) == 1 else values


def _kind(causes: Sequence[Cause]) -> str:
    if not causes:
        return "adequate"
    if any(not cause.in_library for cause in causes):
        return "outside"
    return "library" if len(causes) == 1 else "double"
