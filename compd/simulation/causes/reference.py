"""Causes by which an instrument that stands on the surface plate shows another place than the tip's."""

from __future__ import annotations

import numpy as np
from scipy.integrate import simpson
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, CauseInputs, Values, parts
from compd.simulation.truth.frame import FOOT_BELOW_PLATE_MM
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.weather import MIDDLE_HUMIDITY_pct, REFERENCE_degC, STANDARD_PRESSURE_hPa

HOUR_S = 3600.0
# A stand creeps ever more slowly: an adhesive joint or a clamped foot, over days.
CREEP_S = 60 * HOUR_S
# A frame that is turned: its angle counts as the micrometres that it moves a place this far away.
LEVER_MM = 200.0


class PlateBending(Cause):
    """The plate bows to a cap: its curvature is 12 a / h^3 times the moment of its temperatures over the thickness.

    The temperatures' places lie evenly from face to face. An instrument that stands on the plate's surface
    beneath the tip sees the tip lower by what the surface there has risen over the plate points.
    """

    id, unit, least, most = "plate_bending", "ppm/K", 4.0, 12.0

    def reference(self, now: CauseInputs) -> FloatArray:
        thickness = self.machine.geometry.plate_thickness_mm or FOOT_BELOW_PLATE_MM
        plate_K = now.warm.plate_K
        height = np.linspace(thickness / 2, -thickness / 2, len(plate_K))
        moment = -float(simpson(plate_K * height, x=height))
        curvature = 12 * self.strength * PPM / thickness**3 * moment
        middle = self.machine.plate0_M.mean(axis=0)
        rim_squared = ((self.machine.plate0_M - middle)[:, :2] ** 2).sum(axis=1).mean()
        here_squared = ((now.tip_M - middle)[:2] ** 2).sum()
        # the cap's height without the difference of two large radii
        sphere = np.sqrt(1 - curvature**2 * np.array([here_squared, rim_squared]))
        risen = curvature * (rim_squared - here_squared) / sphere.sum()
        return np.array([0.0, 0.0, -risen])


class ReferenceDrift(Cause):
    """The instrument's stand creeps from the moment it was set up, every day a little less."""

    id, unit, most, signed = "reference_drift", "um/h", 5.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._um_per_h = strength * parts(rng, 3)

    @property
    def values(self) -> Values:
        return tuple(self._um_per_h.tolist())

    def reference(self, now: CauseInputs) -> FloatArray:
        crept_h = -CREEP_S * float(np.expm1(-now.time_s / CREEP_S)) / HOUR_S
        return np.asarray(UM * self._um_per_h * crept_h)


class ReferenceAirIndex(Cause):
    """A laser's wavelength in air that the instrument takes to be 20 degC, 1013.25 hPa, 50 %; beams from {M}'s origin.

    Strength: the share that is not corrected.
    """

    id, unit, most = "reference_air_index", "1", 1.5

    def reference(self, now: CauseInputs) -> FloatArray:
        reference = refractivity(REFERENCE_degC, STANDARD_PRESSURE_hPa, MIDDLE_HUMIDITY_pct)
        wrong = refractivity(now.warm.room_degC, now.pressure_hPa, now.humidity_pct) - reference
        return np.asarray(self.strength * wrong / (1 + reference) * now.tip_M)


class ReferenceRegistration(Cause):
    """The instrument was laid over {M} a little off and turned; strength: um, an angle as um at 200 mm."""

    id, unit, most, signed = "reference_registration", "um", 1000.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        own = strength * parts(rng, 2, 3)
        self._off_M = UM * own[0]
        self._turn = Rotation.from_rotvec(UM * own[1] / LEVER_MM)
        self._values = tuple((own * [[1.0], [1e3 / LEVER_MM]]).ravel().tolist())

    @property
    def values(self) -> Values:
        """Three of um, three of urad."""
        return self._values

    def reference(self, now: CauseInputs) -> FloatArray:
        return np.asarray(self._off_M + self._turn.apply(now.tip_M) - now.tip_M)


def refractivity(air_degC: float, pressure_hPa: float, humidity_pct: float) -> float:
    """n - 1 of air at 633 nm: K. P. Birch and M. J. Downs, Metrologia 31 (1994) 315, equations (1) to (3).

    Saturation pressure of water after Magnus, as in WMO-No. 8.
    """
    wavenumber_squared = 0.6329908**-2  # 1/um2, helium-neon laser in vacuum
    pressure_Pa = 100 * pressure_hPa
    standard = 1e-8 * (8342.54 + 2406147 / (130 - wavenumber_squared) + 15998 / (38.9 - wavenumber_squared))
    dry = standard * pressure_Pa / 96095.43
    dry *= (1 + 1e-8 * (0.601 - 0.00972 * air_degC) * pressure_Pa) / (1 + 0.0036610 * air_degC)
    vapour_Pa = humidity_pct / 100 * 611.2 * float(np.exp(17.62 * air_degC / (243.12 + air_degC)))
    return float(dry - 1e-10 * vapour_Pa * (3.7345 - 0.0401 * wavenumber_squared))


CAUSES = (PlateBending, ReferenceDrift, ReferenceAirIndex, ReferenceRegistration)
