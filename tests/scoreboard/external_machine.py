"""A simulated machine that compd does not know: its recordings, and the file of its effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from tests.scoreboard.case import Case

UM = 1e-3


class Recorded(NamedTuple):
    """A recording of a machine.

    strengths : of what was hidden, by effect, as its formula has them. left_um : what no analysis can take away, rms.
    """

    columns: dict[str, FloatArray]
    sidecar: dict[str, Any]
    strengths: dict[str, float]
    left_um: float


@dataclass(frozen=True)
class ExternalMachine:
    """causes : that can be hidden in it, ids of its effects. constants : ids of effects that are always there.

    effects : the file that declares them. record : the recording of a case with this number.
    """

    causes: tuple[str, ...]
    constants: tuple[str, ...]
    effects: Path
    unit: str
    record: Callable[[Case, int], Recorded]


def sidecar() -> dict[str, Any]:
    """No uncertainty is declared: nobody knows it."""
    return {"format": 2, "machine": "external", "reference": {"quantity": "tool_position", "frame": "machine"}}


def rounded(strength: np.floating[Any]) -> float:
    """Six digits, as an answer has them."""
    return float(f"{strength:.6g}")
