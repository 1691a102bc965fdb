"""Displays that have lost their parameters, and gauges that come back as others."""

from __future__ import annotations

import math
from collections.abc import Callable

from tests.injection.beginnings import REOPENED_S, at_zero, back_with, on, ports_exchanged, without_power
from tests.injection.case import Begin, Case, Way
from tests.injection.faults import Fault
from tests.injection.signal_faults import Scaled

DISPLAY = "Displays"
PER_INCH = 1 / 25.4


def scaled(factor: float) -> Callable[[], Fault]:
    return lambda: Scaled(("position",), factor)


def _display(
    id: str, fault: str, injected: str, begin: Begin, drives: bool = False, unseen: str = "", watched_s: float = 1.5
) -> Case:
    """What is wrong of it is held against the bound that the setpoint itself states."""
    return Case(
        id,
        DISPLAY,
        fault,
        injected,
        begin,
        Way.EITHER,
        bound_um=math.inf,
        watched_s=watched_s,
        drives=drives,
        unseen=unseen,
    )


DISPLAYS: tuple[Case, ...] = (
    _display(
        "scale-direction-lost",
        "a display without power at machine zero has lost its counting direction",
        "scale 1 unplugged for 1 s at 0; then it shows -1 times its number; all links drive",
        at_zero(without_power("scale_1", scaled(-1.0))),
        drives=True,
        unseen="display_parameters_at_zero",
    ),
    _display(
        "scale-inch-at-zero",
        "a display is switched to inches at machine zero",
        "scale 1 shows inches from 0 on; all links drive",
        at_zero(on("scale_1", scaled(PER_INCH))),
        drives=True,
        unseen="display_parameters_at_zero",
    ),
    _display(
        "scale-gain-lost",
        "a display without power at machine zero has lost its gain",
        "scale 1 unplugged for 1 s at 0; then it shows 0.9 of its number; all links drive",
        at_zero(without_power("scale_1", scaled(0.9))),
        drives=True,
        unseen="display_parameters_at_zero",
    ),
    _display(
        "scale-inch",
        "a display is switched to inches",
        "scale 1 shows inches from now on",
        on("scale_1", scaled(PER_INCH)),
    ),
    _display(
        "scale-back-off",
        "a display comes back with nearly the same number",
        "scale 1 unplugged for 2 s; then it shows 0.2 mm less",
        back_with("scale_1", "position", -0.2),
        watched_s=REOPENED_S,
    ),
    _display(
        "ports-exchanged",
        "two ports are exchanged in the configuration, which the daemon is told to read anew",
        "ports of scale 1 and scale 2 exchanged, SIGHUP",
        ports_exchanged("scale_1", "scale_2"),
        watched_s=6.0,
    ),
)
