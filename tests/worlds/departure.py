"""Blind spot of a departure: the machine has left its place, and no reading since then shows it."""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray
from compd.live.loop import Setpoint
from tests.worlds.faults.wiring import wired
from tests.worlds.world import Told, World

# A change of a reading shows motion from so many times its noise on.
SIGMAS = 5.0
# A reading that is so much younger than a departure shows it, s.
SHOWS_AFTER_S = 0.02
_MM_PER_UM = 1e-3


class Departure:
    """Follows a world's scales from its last rest; called with every setpoint."""

    def __init__(self, world: World) -> None:
        configuration = world.configuration
        names = [
            f"{gauge}.{channel.name}"
            for gauge, driver in configuration.gauge_objects().items()
            for channel in driver.channels
        ]
        scales = [channel for channel in wired(configuration) if channel.kind == "scale"]
        noise_um = [configuration.gauges[channel.gauge].noise_um or math.inf for channel in scales]
        self._world = world
        self._at = [names.index(channel.name) for channel in scales]
        self._shows_mm = SIGMAS * _MM_PER_UM * np.array(noise_um)
        self._left_s = math.inf
        self._rest_mm = self._true_mm = np.full(len(scales), math.nan)

    def unseen(self, setpoint: Setpoint, told: Told) -> bool:
        """Whether the machine has left, and no reading of a scale since then shows it.

        A scale that moves and was read later than `SHOWS_AFTER_S` after the departure shows it, whatever it says.
        """
        if setpoint.inputs is None or not self._at:
            return False
        slots = setpoint.inputs.snapshot.readings.slots[self._at]
        read_mm, read_s = slots["value"], slots["time_s"]
        true_mm = self._world.scale_mm()
        if told.moving and self._left_s == math.inf:
            self._left_s = told.time_s - getattr(self._world.truth._motion, "_since_s", 0.0)
        moved = np.abs(true_mm - self._true_mm) > self._shows_mm
        seen = (np.abs(read_mm - self._rest_mm) > self._shows_mm) | (moved & (read_s > self._left_s + SHOWS_AFTER_S))
        if seen.any() or not (told.moving or moved.any()):
            if not told.moving:
                self._rests(read_mm, true_mm)
            return False
        return self._left_s < math.inf

    def _rests(self, read_mm: FloatArray, true_mm: FloatArray) -> None:
        self._left_s, self._rest_mm, self._true_mm = math.inf, read_mm.copy(), true_mm
