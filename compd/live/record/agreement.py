"""How far a replayed setpoint agrees with the one that was sent: one of three."""

from __future__ import annotations

import json
from enum import StrEnum
from typing import Any

from compd.live.loop import Setpoint

# What another order of the same additions changes: nine last bits of a length of 500 mm.
SAME_BY_ANOTHER_KERNEL_MM = 1e-12


class Agreement(StrEnum):
    """One of three. Each value is what `compd recording replay` says of it."""

    SAME = "the same to the last bit"
    ANOTHER_KERNEL = "within 1e-12 mm by another kernel"
    DIFFERENT = "different"


def agreement(sent: bytes, replayed: Setpoint, another_kernel: bool) -> Agreement:
    """How far the line that was sent agrees with the setpoint that is computed now.

    The line has rounded numbers. Each of them must be what a number within 1e-12 mm of the present one is rounded to,
    where another kernel made it; all else is the same.

    Parameters
    ----------
    another_kernel : whether the line was computed by other kernels, or by kernels that are not known.
    """
    if sent == replayed.to_json():
        return Agreement.SAME
    if not another_kernel:
        return Agreement.DIFFERENT
    low, high = (replayed.message(moved_mm) for moved_mm in (-SAME_BY_ANOTHER_KERNEL_MM, SAME_BY_ANOTHER_KERNEL_MM))
    return Agreement.ANOTHER_KERNEL if _is_between(json.loads(sent), low, high) else Agreement.DIFFERENT


def _is_between(sent: Any, low: Any, high: Any) -> bool:
    """Whether every number is between those of the same place, and all else is the same."""
    if isinstance(sent, dict) and isinstance(low, dict):
        return sent.keys() == low.keys() and all(_is_between(sent[key], low[key], high[key]) for key in sent)
    if isinstance(sent, list) and isinstance(low, list):
        return len(sent) == len(low) and all(map(_is_between, sent, low, high))
    if isinstance(sent, float) and isinstance(low, float):
        return bool(low <= sent <= high)
    return bool(isinstance(sent, bool) is isinstance(low, bool) and sent == low)
