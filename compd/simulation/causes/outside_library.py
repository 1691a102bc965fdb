"""Causes that the effect library does not have: whoever diagnoses these must name none of its effects."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import UM, Cause, CauseInputs, Values, parts
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.weather import MIDDLE_HUMIDITY_pct, STANDARD_PRESSURE_hPa

# A cable comes taut this far from machine zero; its drag is stated this much farther.
TAUT_AT_MM = 10.0
STATED_AFTER_MM = 100.0


class HumiditySwelling(Cause):
    """Links of carbon fibre take up water from the air and grow, all alike."""

    id, unit, most, in_library, follows = "humidity_swelling", "um/pct", 0.5, False, ("humidity_pct",)

    def link_mm(self, now: CauseInputs) -> FloatArray:
        wetter_pct = now.humidity_pct - MIDDLE_HUMIDITY_pct
        return np.asarray(self.strength * UM * wetter_pct * now.link_mm / self.machine.lengths0_mm)


class PlateSwelling(Cause):
    """Granite whose top face takes up water bows upwards; the tip over its middle stands lower."""

    id, unit, most, in_library, follows = "plate_swelling", "um/pct", 0.5, False, ("humidity_pct",)

    def reference(self, now: CauseInputs) -> FloatArray:
        plate = self.machine.plate0_M - self.machine.plate0_M.mean(axis=0)
        share = 1 - (now.tip_M[:2] ** 2).sum() / (plate[:, :2] ** 2).sum(axis=1).mean()
        return np.array([0.0, 0.0, -self.strength * UM * (now.humidity_pct - MIDDLE_HUMIDITY_pct) * share])


class AirPressure(Cause):
    """Sealed bellows around the links push on the platform as the weather's pressure changes."""

    id, unit, most, in_library, follows = "air_pressure", "um/hPa", 0.5, False, ("pressure_hPa",)

    def link_mm(self, now: CauseInputs) -> FloatArray:
        pressed = -self.strength * UM * (now.pressure_hPa - STANDARD_PRESSURE_hPa)
        return np.full(self.machine.links, pressed)


class CableDrag(Cause):
    """A cable from the wall hangs slack; it comes taut as the platform goes away along x, and drags at the tool."""

    id, unit, most, in_library, follows = "cable_drag", "um", 20.0, False, ("position",)

    def tool(self, now: CauseInputs) -> FloatArray:
        away = max(0.0, float(now.tip_M[0] - self.machine.tip0_M[0]) - TAUT_AT_MM) / STATED_AFTER_MM
        return self.strength * UM * away * np.array([-1.0, 0.0, 0.3])


class CollisionStep(Cause):
    """The tool was hit once, and has been elsewhere since."""

    id, unit, most, signed, in_library, follows = "collision_step", "um", 50.0, True, False, ("time_s",)

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self.hit_s = float(rng.uniform(5000.0, 40000.0))
        self._um = strength * parts(rng, 3)

    @property
    def values(self) -> Values:
        return tuple(self._um.tolist())

    def tool(self, now: CauseInputs) -> FloatArray | float:
        return UM * self._um if now.time_s >= self.hit_s else 0.0


class RoomBreathing(Cause):
    """Ventilation switches on and off; the floor, and with it the instrument's stand, goes up and down."""

    id, unit, most, in_library, follows = "room_breathing", "um", 10.0, False, ("time_s",)

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self.period_s = float(rng.uniform(600.0, 1500.0))
        self._phase_rad = rng.uniform(0, 2 * np.pi)

    def reference(self, now: CauseInputs) -> FloatArray:
        turn = 2 * np.pi * now.time_s / self.period_s
        wave = np.sin(turn + self._phase_rad) - np.sin(self._phase_rad)
        return np.asarray(self.strength * UM * wave * np.array([0.3, 0.0, 1.0]))


CAUSES = (HumiditySwelling, PlateSwelling, AirPressure, CableDrag, CollisionStep, RoomBreathing)
