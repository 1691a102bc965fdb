"""Thermometers that are wrong, on a machine that is corrected by them."""

from __future__ import annotations

import math

from tests.injection.beginnings import away, drifting, on, once, shows
from tests.injection.case import Begin, Case, Way
from tests.injection.faults import Off
from tests.injection.signal_faults import Noisy

THERMOMETER = "Thermometers"


def _thermometer(id: str, fault: str, injected: str, begin: Begin, watched_s: float = 2.0, unseen: str = "") -> Case:
    """What is wrong of it is held against the bound that the setpoint itself states."""
    return Case(
        id,
        THERMOMETER,
        fault,
        injected,
        begin,
        Way.EITHER,
        bound_um=math.inf,
        watched_s=watched_s,
        unseen=unseen,
        expands=True,
    )


THERMOMETERS: tuple[Case, ...] = (
    _thermometer(
        "thermometer-open",
        "a thermometer's wire breaks",
        "link_1 shows 327.67 degC",
        shows("cabinet", "link_1", 327.67),
    ),
    _thermometer(
        "thermometer-zero",
        "a thermometer's register is empty",
        "link_1 shows 0.00 degC",
        shows("cabinet", "link_1", 0.0),
    ),
    _thermometer(
        "thermometer-jumps",
        "a thermometer jumps",
        "link_1 + 5 K from now on",
        on("cabinet", lambda: Off(("link_1",), 5.0)),
    ),
    _thermometer(
        "thermometer-once", "one reading of a thermometer is off", "link_1 + 5 K, once", once("cabinet", "link_1", 5.0)
    ),
    _thermometer(
        "thermometer-noisy",
        "a thermometer is noisy",
        "link_1 with noise of 1 K standard deviation",
        on("cabinet", lambda: Noisy(("link_1",), 1.0, seed=14)),
        watched_s=4.0,
    ),
    _thermometer(
        "thermometer-drifts",
        "a thermometer runs away faster than a part warms up",
        "link_1 + 1 K every second",
        drifting("cabinet", "link_1", 1.0),
        watched_s=4.0,
        unseen="wrong_thermometer",
    ),
    _thermometer(
        "thermometers-unplugged",
        "the cabinet with the thermometers is away and comes back",
        "cabinet unplugged for 1 s",
        away("cabinet"),
    ),
)
