"""Causes in the reference instrument on the surface plate: it shows a place other than the tip's."""

from __future__ import annotations

import numpy as np
from scipy.integrate import simpson
from scipy.spatial.transform import Rotation

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, CauseInputs, unit_rms_scatter
from compd.simulation.truth.frame import FOOT_BELOW_PLATE_MM
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.weather import MIDDLE_HUMIDITY_pct, REFERENCE_degC, STANDARD_PRESSURE_hPa

HOUR_S = 3600.0
# Time constant of a stand's creep: an adhesive joint or a clamped foot, over days.
CREEP_S = 60 * HOUR_S
# An angle is stated as the micrometres by which it moves a place at this distance.
LEVER_MM = 200.0


class PlateBending(Cause):
    """Bending of the surface plate by its vertical temperature gradient: it bows to a spherical cap.

    curvature = 12 alpha / h^3 times the integral of T(z) z dz over the thickness h (B. A. Boley, J. H. Weiner, Theory
    of Thermal Stresses, 1960), by Simpson's rule over layers that lie evenly from face to face. The
    instrument sees the tip lower by what the surface beneath has risen over the plate points. Strength: alpha
    (granite 4 to 8 ppm/K).
    """

    id = "plate_bending"
    unit = "ppm/K"
    min_strength = 4.0
    max_strength = 12.0
    acts_on_frame = True

    def reference_shift(self, inputs: CauseInputs) -> FloatArray:
        thickness = self.mechanism.geometry.plate_thickness_mm or FOOT_BELOW_PLATE_MM
        plate_K = inputs.warm.plate_K
        height = np.linspace(thickness / 2, -thickness / 2, len(plate_K))
        moment = -float(simpson(plate_K * height, x=height))
        curvature = 12 * self.strength * PPM / thickness**3 * moment
        middle = self.mechanism.plate0_M.mean(axis=0)
        rim_squared = ((self.mechanism.plate0_M - middle)[:, :2] ** 2).sum(axis=1).mean()
        tip_squared = ((inputs.tip_M - middle)[:2] ** 2).sum()
        # the cap's height, written so that no two large radii are subtracted
        sphere = np.sqrt(1 - curvature**2 * np.array([tip_squared, rim_squared]))
        risen = curvature * (rim_squared - tip_squared) / sphere.sum()
        return np.array([0.0, 0.0, -risen])


class ReferenceDrift(Cause):
    """Creep of the instrument's stand from when it was set up: shift = v tau (1 - exp(-t / tau)), tau = 60 h.

    Strength: root mean square of the three components of the initial velocity v.
    """

    id = "reference_drift"
    unit = "um/h"
    max_strength = 5.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, 3)

    def reference_shift(self, inputs: CauseInputs) -> FloatArray:
        crept_h = -CREEP_S * float(np.expm1(-inputs.time_s / CREEP_S)) / HOUR_S
        return np.asarray(UM * self.part_strengths * crept_h)


class ReferenceAirIndex(Cause):
    """Laser wavelength in air that is not corrected for weather: shift = k (n - n0) / n0 tip_M, n0 at 20 degC,
    1013.25 hPa, 50 %; the beams start at the origin of {M}.

    n by `refractivity`. Strength: k, the share of the change that is not corrected.
    """

    id = "reference_air_index"
    unit = "1"
    max_strength = 1.5

    def reference_shift(self, inputs: CauseInputs) -> FloatArray:
        reference = refractivity(REFERENCE_degC, STANDARD_PRESSURE_hPa, MIDDLE_HUMIDITY_pct)
        change = refractivity(inputs.warm.room_degC, inputs.pressure_hPa, inputs.humidity_pct) - reference
        return np.asarray(self.strength * change / (1 + reference) * inputs.tip_M)


class ReferenceRegistration(Cause):
    """Wrong rigid registration of the instrument's frame to {M}: shift = d + (R - 1) tip_M.

    Strength: root mean square of d's components, um, and of the rotation vector's as um at a distance of 200 mm.
    """

    id = "reference_registration"
    unit = "um"
    max_strength = 1000.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        offset_um, turn_um = strength * unit_rms_scatter(rng, 2, 3)
        self._offset_M = UM * offset_um
        self._turn = Rotation.from_rotvec(UM * turn_um / LEVER_MM)
        # three in um, three in urad
        self.part_strengths = np.array([offset_um, turn_um * (1e3 / LEVER_MM)])

    def reference_shift(self, inputs: CauseInputs) -> FloatArray:
        return np.asarray(self._offset_M + self._turn.apply(inputs.tip_M) - inputs.tip_M)


def refractivity(air_degC: float, pressure_hPa: float, humidity_pct: float) -> float:
    """n - 1 of air at 633 nm: K. P. Birch and M. J. Downs, Metrologia 31 (1994) 315, equations (1) to (3).

    Saturation pressure of water after Magnus, as in WMO-No. 8. Example: refractivity(20, 1013.25, 0) = 2.718e-4.
    """
    wavenumber_squared = 0.6329908**-2  # 1/um2, helium-neon laser in vacuum
    pressure_Pa = 100 * pressure_hPa
    standard = 1e-8 * (8342.54 + 2406147 / (130 - wavenumber_squared) + 15998 / (38.9 - wavenumber_squared))
    dry = standard * pressure_Pa / 96095.43
    dry *= (1 + 1e-8 * (0.601 - 0.00972 * air_degC) * pressure_Pa) / (1 + 0.0036610 * air_degC)
    vapour_Pa = humidity_pct / 100 * 611.2 * float(np.exp(17.62 * air_degC / (243.12 + air_degC)))
    return float(dry - 1e-10 * vapour_Pa * (3.7345 - 0.0401 * wavenumber_squared))


CAUSES = (PlateBending, ReferenceDrift, ReferenceAirIndex, ReferenceRegistration)
