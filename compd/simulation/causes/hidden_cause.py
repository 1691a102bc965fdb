"""A cause to be hidden in a simulated machine: stated by a person or drawn from a number, and its answer file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.errors import CompdError, Problem
from compd.files import write_files
from compd.operation_settings import Wiring
from compd.simulation.causes.catalogue import CAUSES, possible_causes, shuffle_causes
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.mechanism import Mechanism

# Size of a drawn cause: rms error at the tip over the reference's noise, from barely visible to plain.
MIN_FLOORS = 1.0
MAX_FLOORS = 6.0
# Probability that a drawn cause is none of the library's.
OUTSIDE_SHARE = 0.2


class HiddenCause(NamedTuple):
    """A cause by id. strength: as `Cause.strength`; None: such that the tip's error is `floors` times the noise."""

    id: str
    strength: float | None
    floors: float = 3.0


class SizedCause(NamedTuple):
    """A cause, and the size of the tip's error that it causes: rms per coordinate over the reference's sigma."""

    cause: Cause
    floors: float


def parse_hidden(texts: Sequence[str]) -> list[HiddenCause]:
    """Causes from `id=strength`, or `id` alone for three times the noise. Raises CompdError with every problem."""
    hidden, problems = [], []
    for text in texts:
        name, separator, number = text.partition("=")
        try:
            strength = float(number) if separator else None
        except ValueError:
            strength = float("nan")
        if name not in CAUSES:
            problems.append(Problem("--effect", "no such cause", value=name, allowed=", ".join(CAUSES)))
        elif strength is not None and (not np.isfinite(strength) or strength == 0):
            problems.append(
                Problem(f"--effect {name}", "is no strength", value=number, allowed=f"a number in {CAUSES[name].unit}")
            )
        elif strength is not None and CAUSES[name].stated_as_reciprocal:
            strength = 1 / strength
        hidden.append(HiddenCause(name, strength))
    if problems:
        raise CompdError(problems)
    return hidden


def draw_hidden(seed: int, mechanism: Mechanism, wiring: Wiring | None = None) -> HiddenCause:
    """Cause and size that follow from `seed` alone, among the causes that this machine can have.

    wiring : as in `possible_causes`.

    With one cause more in the catalogue, the draw is the same for every seed by which the new one is not drawn.
    """
    rng = np.random.default_rng([seed, 0x5EA1])
    outside = rng.uniform() < OUTSIDE_SHARE
    names = [name for name in possible_causes(mechanism, wiring) if CAUSES[name].in_library != outside]
    first, *_ = shuffle_causes(names, seed, "hidden")
    return HiddenCause(first, None, float(rng.uniform(MIN_FLOORS, MAX_FLOORS)))


def write_answer(path: Path, hidden: Sequence[SizedCause], weak: Sequence[Cause], seed: int) -> None:
    """Write NAME.answer.json for a scorer, as `answer` has it."""
    case = {"case": path.name.removesuffix(".answer.json"), "seed": seed}
    write_files({path: json.dumps(case | answer(hidden, weak), indent=1) + "\n"})


def answer(hidden: Sequence[SizedCause], weak: Sequence[Cause]) -> dict[str, object]:
    """The hidden causes, their strengths and the tip's error that they cause; `weak` : additional disturbances."""
    causes = [sized.cause for sized in hidden]
    return {
        "effects": {cause.id: _strengths(cause) for cause in causes},
        "answers": [cause.id for cause in causes if cause.in_library],
        "follows": [name for cause in causes for name in cause.covariates],
        "kind": _kind(causes),
        "units": {cause.id: cause.unit for cause in causes},
        "error_in_floors": {sized.cause.id: round(sized.floors, 3) for sized in hidden},
        "weak_disturbances": {cause.id: _strengths(cause) for cause in weak},
    }


def _strengths(cause: Cause) -> float | list[float]:
    """Six digits; a plain number for a cause with a single strength."""
    values = [float(f"{value:.6g}") for value in cause.values]
    return values[0] if len(values) == 1 else values


def _kind(causes: Sequence[Cause]) -> str:
    """Kind of case, as the answer file names it."""
    if not causes:
        return "adequate"
    if any(not cause.in_library for cause in causes):
        return "outside"
    return "library" if len(causes) == 1 else "double"
