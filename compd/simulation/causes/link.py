"""Causes in the links: changes of a link's length that neither its scale nor its joint comparators measure."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, CauseInputs, Interval, unit_rms_scatter
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import LINK_PIECES, WarmUp

# Share of the rod's heat exchange by contact with the tube, without delay; the rest is by radiation and air.
CONTACT_SHARE = 0.1
# Share of the link's compliance that is the tube's and grows with its length; screw and bearings have the rest.
TUBE_SHARE = 0.3
# Preload of a ball between its two seats: just enough to keep both contacts closed.
PRELOAD_N = 2.0
# Length for which the sag's strength is stated: that of an ordinary machine of this size.
SAG_LENGTH_MM = 500.0
BISECTIONS = 60


class LinkExpansion(Cause):
    """Thermal expansion of rods and scale carrier: extension_i = alpha L_i mean over the link's pieces (dT),
    dT since machine zero.

    Strength: alpha (steel 11, aluminium 23 ppm/K).
    """

    id = "link_expansion"
    unit = "ppm/K"
    max_strength = 23.0

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        return np.asarray(self.strength * PPM * inputs.link_mm * inputs.warm.link_pieces_K.mean(axis=1))


class LinkExpansionLag(Cause):
    """Thermal expansion of rods that hang free in the tube and follow its temperature late, by radiation and air.

    tau dT_rod/dt = T_tube - T_rod for each piece; extension_i = alpha L_i mean(0.9 T_rod + 0.1 T_tube), both
    since machine zero.
    Strength: alpha. The lag tau is drawn between 240 and 1500 s.
    """

    id = "link_expansion_lag"
    unit = "ppm/K"
    max_strength = 23.0

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.tau_s = float(np.exp(rng.uniform(np.log(240.0), np.log(1500.0))))
        self._tube_K: FloatArray = np.zeros((mechanism.links, LINK_PIECES))
        self._rod_K: FloatArray = np.zeros((mechanism.links, LINK_PIECES))

    def pass_time(self, interval: Interval, warm: WarmUp) -> None:
        """Exact solution for a tube temperature that changes linearly over the interval."""
        tube_K = warm.link_pieces_K
        steps = interval.weather_s / self.tau_s
        if steps > 0:
            ramp = -np.expm1(-steps) / steps
            self._rod_K = tube_K + (self._rod_K - self._tube_K) * np.exp(-steps) - (tube_K - self._tube_K) * ramp
        self._tube_K = tube_K

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        rods_K = (1 - CONTACT_SHARE) * self._rod_K + CONTACT_SHARE * self._tube_K
        return np.asarray(self.strength * PPM * inputs.link_mm * rods_K.mean(axis=1))


class LinkElasticity(Cause):
    """Axial compliance of tube and screw between the comparators.

    extension_i = c (0.7 + 0.3 L_i/L0_i) F_i - c F0_i, F the axial force and F0, L0 force and length at machine zero.
    Strength: the compliance c in um/N; stated as the stiffness 1/c in N/um.
    """

    id = "link_elasticity"
    unit = "N/um"
    min_strength = 0.005
    max_strength = 0.2
    stated_as_reciprocal = True

    @property
    def values(self) -> tuple[float, ...]:
        """Stiffness, N/um."""
        return (1 / self.strength,) if self.strength else (float("inf"),)

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        length = inputs.link_mm / self.mechanism.lengths0_mm
        compliance_mm_per_N = self.strength * UM * (1 - TUBE_SHARE + TUBE_SHARE * length)
        return np.asarray(compliance_mm_per_N * inputs.axial_N - self.strength * UM * inputs.axial0_N)


class JointContact(Cause):
    """Hertzian contact of a preloaded ball between two seats, in line with the link.

    Each seat: F = (a / c)^(3/2) for the approach a (K. L. Johnson, Contact Mechanics, 1985, equation (4.23)).
    extension_i = a(F_i) - a(F0_i), a solved by bisection. Strength: c.
    """

    id = "joint_contact"
    unit = "um/N^(2/3)"
    min_strength = 0.01
    max_strength = 1.0

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        # forces at machine zero and the approaches that belong to them, which one machine keeps
        self._at_zero: tuple[FloatArray, FloatArray] | None = None

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        if self._at_zero is None or self._at_zero[0] is not inputs.axial0_N:
            self._at_zero = inputs.axial0_N, self._approach_mm(inputs.axial0_N)
        return np.asarray(self._approach_mm(inputs.axial_N) - self._at_zero[1])

    def _approach_mm(self, force_N: FloatArray) -> FloatArray:
        """(n,) displacement at which the forces of the two seats differ by `force_N`."""
        contact = max(self.strength * UM, 1e-12)
        closed = contact * PRELOAD_N ** (2 / 3)
        wanted = np.abs(force_N)
        low, high = np.zeros_like(force_N), np.full_like(force_N, contact * (wanted.max() + 4) ** (2 / 3))
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            load = ((closed + middle) / contact) ** 1.5 - (np.maximum(closed - middle, 0) / contact) ** 1.5
            short = load < wanted
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return np.asarray(np.sign(force_N) * high) if self.strength else np.zeros_like(force_N)


class LinkSag(Cause):
    """Bending of a leaning link under its own weight: the chord is shorter than the arc that rods and scale follow.

    Evenly loaded beam on two supports (Roark's Formulas for Stress and Strain, table 8.1): half the integral of the
    squared slope is 17 q^2 L^7 / (40320 (E I)^2), q the weight per length across the link.
    Strength: the shortening of a level link of 500 mm.
    """

    id = "link_sag"
    unit = "um"
    max_strength = 20.0

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        across_squared = 1 - inputs.directions_M[:, 2] ** 2
        return np.asarray(-self.strength * UM * across_squared * (inputs.link_mm / SAG_LENGTH_MM) ** 7)


class LinkZero(Cause):
    """Wrong length of each link at machine zero: extension_i = z_i, constant; strength: root mean square of the z_i."""

    id = "link_zero"
    unit = "um"
    max_strength = 50.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, mechanism.links)

    def link_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        return np.asarray(UM * self.part_strengths)


CAUSES = (LinkExpansion, LinkExpansionLag, LinkElasticity, JointContact, LinkSag, LinkZero)
