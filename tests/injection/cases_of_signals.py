"""Signals that are wrong before they are digitised: signal periods that are not counted, noise, hum, coarse digits."""

from __future__ import annotations

import math

from tests.injection.beginnings import on
from tests.injection.case import Case, Way
from tests.injection.faults import Fault
from tests.injection.signal_faults import Coarse, Hum, Noisy, Scaled, Steps

SIGNAL = "Signals"
HEADS = tuple(str(head) for head in range(1, 10))
RODS = tuple(f"u{rod}" for rod in range(1, 7))
# The shipped machine's `scale_signal_period_mm`.
PERIOD_MM = 0.02


def _signal(
    id: str, fault: str, injected: str, line: str, made: Fault, watched_s: float = 2.0, unseen: str = ""
) -> Case:
    """What is wrong of it is held against the bound that the setpoint itself states. made : it keeps no state."""
    begin = on(line, lambda: made)
    return Case(id, SIGNAL, fault, injected, begin, Way.EITHER, bound_um=math.inf, watched_s=watched_s, unseen=unseen)


SIGNALS: tuple[Case, ...] = (
    _signal(
        "scale-loses-period",
        "a scale loses a signal period",
        "scale 1 + 20 um from now on",
        "scale_1",
        Steps(("position",), PERIOD_MM, every_s=0.3, count=1),
        unseen="lost_signal_periods",
    ),
    _signal(
        "scale-loses-periods",
        "a scale loses one signal period after the other",
        "scale 1 + 20 um every 0.3 s, ten times",
        "scale_1",
        Steps(("position",), PERIOD_MM, every_s=0.3, count=10),
        watched_s=4.0,
        unseen="lost_signal_periods",
    ),
    _signal(
        "scale-noisy",
        "a scale's signal is noisy",
        "scale 1 with noise of 5 um standard deviation",
        "scale_1",
        Noisy(("position",), 0.005, seed=11),
        watched_s=4.0,
    ),
    _signal(
        "scale-hum-5um",
        "the mains hum in a scale's signal",
        "scale 1 with 50 Hz of 5 um",
        "scale_1",
        Hum(("position",), 0.005),
        watched_s=4.0,
    ),
    _signal(
        "scale-hum-20um",
        "the mains hum loudly in a scale's signal",
        "scale 1 with 50 Hz of 20 um",
        "scale_1",
        Hum(("position",), 0.02),
        watched_s=4.0,
    ),
    _signal(
        "joints-noisy",
        "the joint comparators are noisy",
        "all heads with noise of 2 um standard deviation",
        "joints",
        Noisy(HEADS, 0.002, seed=12),
        watched_s=4.0,
    ),
    _signal(
        "frame-noisy",
        "the frame comparators are noisy",
        "u1 to u6 with noise of 2 um standard deviation",
        "frame_u",
        Noisy(RODS, 0.002, seed=13),
        watched_s=4.0,
    ),
    _signal(
        "frame-hum",
        "the mains hum in the frame comparators",
        "u1 to u6 with 50 Hz of 5 um",
        "frame_u",
        Hum(RODS, 0.005),
        watched_s=4.0,
    ),
    _signal(
        "scale-coarse",
        "a display is set to a coarser last digit",
        "scale 1 in steps of 10 um",
        "scale_1",
        Coarse(("position",), 0.01),
        watched_s=4.0,
        unseen="scatter",
    ),
    _signal(
        "joints-coarse",
        "the joints' unit is set to a coarser last digit",
        "all heads in steps of 1 um",
        "joints",
        Coarse(HEADS, 0.001),
        watched_s=4.0,
        unseen="scatter",
    ),
    _signal(
        "scale-gain-drifts",
        "a scale's gain drifts",
        "scale 1 shows 0.1 % more every second",
        "scale_1",
        Scaled(("position",), per_s=0.001),
        watched_s=4.0,
        unseen="drift_of_a_scale",
    ),
    Case(
        "machine-departs",
        SIGNAL,
        "no fault: the machine leaves after a long rest",
        "all links drive 7 mm",
        lambda machine: machine.drive_away(),
        Way.UNDISTURBED,
        bound_um=math.inf,
        unseen="departure_from_rest",
        drives=True,
    ),
)
