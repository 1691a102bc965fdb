"""Causes that make a link longer or shorter than scale and comparators tell."""

from __future__ import annotations

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, CauseInputs, Interval, Values, parts
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import LINK_PIECES, WarmUp

# The rod inside a link's tube: this share of it has touch with the tube at once, the rest behind the lag.
QUICK_SHARE = 0.1
# A tube gives in proportion to its length, its screw and bearings do not.
TUBE_SHARE = 0.3
# Light preload of a ball between its two seats: it keeps the contact closed, no more.
PRELOAD_N = 2.0
# A link's length at which sag is stated: that of an ordinary machine of this size.
SAG_LENGTH_MM = 500.0


class LinkExpansion(Cause):
    """Rods and scale carrier of one material, warm along the link as the link is: every piece grows by its own."""

    id, unit, most = "link_expansion", "ppm/K", 23.0

    def link_mm(self, now: CauseInputs) -> FloatArray:
        return np.asarray(self.strength * PPM * now.link_mm * now.warm.link_pieces_K.mean(axis=1))


class LinkExpansionLag(Cause):
    """The rods hang free in the tube and follow its temperature by radiation and air: late, piece by piece."""

    id, unit, most = "link_expansion_lag", "ppm/K", 23.0

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self.tau_s = float(np.exp(rng.uniform(np.log(240.0), np.log(1500.0))))
        self._tube_K: FloatArray = np.zeros((machine.links, LINK_PIECES))
        self._rod_K: FloatArray = np.zeros((machine.links, LINK_PIECES))

    def pass_time(self, travel: Interval, warm: WarmUp) -> None:
        """Exact for a tube that warms up evenly over the time."""
        tube_K = warm.link_pieces_K
        steps = travel.weather_s / self.tau_s
        if steps > 0:
            ramp = -np.expm1(-steps) / steps
            self._rod_K = tube_K + (self._rod_K - self._tube_K) * np.exp(-steps) - (tube_K - self._tube_K) * ramp
        self._tube_K = tube_K

    def link_mm(self, now: CauseInputs) -> FloatArray:
        rods_K = (1 - QUICK_SHARE) * self._rod_K + QUICK_SHARE * self._tube_K
        return np.asarray(self.strength * PPM * now.link_mm * rods_K.mean(axis=1))


class LinkElasticity(Cause):
    """Tube and screw between the comparators stretch. Strength: what they give at machine zero; stated: stiffness."""

    id, unit, least, most, reciprocal = "link_elasticity", "N/um", 0.005, 0.2, True

    @property
    def values(self) -> Values:
        """N/um, as stiffness is stated."""
        return (1 / self.strength,) if self.strength else (float("inf"),)

    def link_mm(self, now: CauseInputs) -> FloatArray:
        length = now.link_mm / self.machine.lengths0_mm
        gives = self.strength * UM * (1 - TUBE_SHARE + TUBE_SHARE * length)
        return np.asarray(gives * now.axial_N - self.strength * UM * now.axial0_N)


class JointContact(Cause):
    """A ball between two seats, lightly preloaded: each seat is a Hertzian contact, F = (approach / c)^(3/2)."""

    id, unit, least, most = "joint_contact", "um/N^(2/3)", 0.01, 1.0

    def link_mm(self, now: CauseInputs) -> FloatArray:
        return np.asarray(self._approach_mm(now.axial_N) - self._approach_mm(now.axial0_N))

    def _approach_mm(self, force_N: FloatArray) -> FloatArray:
        """Where the force of the one seat less that of the other is `force_N`; by bisection."""
        contact = max(self.strength * UM, 1e-12)
        closed = contact * PRELOAD_N ** (2 / 3)
        low, high = np.zeros_like(force_N), np.full_like(force_N, contact * (np.abs(force_N).max() + 4) ** (2 / 3))
        for _ in range(60):
            middle = (low + high) / 2
            load = (np.maximum(closed + middle, 0) / contact) ** 1.5 - (np.maximum(closed - middle, 0) / contact) ** 1.5
            short = load < np.abs(force_N)
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        return np.asarray(np.sign(force_N) * high) if self.strength else np.zeros_like(force_N)


class LinkSag(Cause):
    """Own weight bows a leaning link, and the chord is shorter than the arc that rods and scale follow.

    Evenly loaded beam on two supports: half the slope's square over the length is 17 q^2 l^7 / (40320 (E I)^2),
    q the weight per length across the link. The strength is that of a level link of 500 mm.
    """

    id, unit, most = "link_sag", "um", 20.0

    def link_mm(self, now: CauseInputs) -> FloatArray:
        across_squared = 1 - now.directions_M[:, 2] ** 2
        return np.asarray(-self.strength * UM * across_squared * (now.link_mm / SAG_LENGTH_MM) ** 7)


class LinkZero(Cause):
    """Machine zero was adjusted a little off: every link by its own amount."""

    id, unit, most, signed = "link_zero", "um", 50.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._um = strength * parts(rng, machine.links)

    @property
    def values(self) -> Values:
        return tuple(self._um.tolist())

    def link_mm(self, now: CauseInputs) -> FloatArray:
        return np.asarray(UM * self._um)


CAUSES = (LinkExpansion, LinkExpansionLag, LinkElasticity, JointContact, LinkSag, LinkZero)
