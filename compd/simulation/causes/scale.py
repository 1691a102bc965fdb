"""Causes in the linear scales: errors between a scale's reading and the length that it stands for."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from operator import itemgetter

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, CauseInputs, Interval, uniform_scatter, unit_rms_scatter
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import LINK_PIECES, WarmUp
from compd.simulation.truth.weather import REFERENCE_degC

MS = 1e-3
# Signal period of the usual exposed scale, where the drawing states none.
DEFAULT_PERIOD_MM = 0.020
# Elements of the Iwan chain: corners per branch of the hysteresis loop.
SLIDERS = 8


class ScaleGain(Cause):
    """Wrong scale factor of the graduation: stretched in mounting, or a long-range error of the ruling engine.

    extension_i = g_i s_i, with one g_i per scale; strength: root mean square of the g_i.
    """

    id = "scale_gain"
    unit = "ppm"
    max_strength = 50.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.part_strengths = strength * unit_rms_scatter(rng, mechanism.scales)

    def scale_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        return np.asarray(PPM * self.part_strengths * inputs.scale_mm)


class ScaleExpansion(Cause):
    """Thermal expansion of the scale tape, which follows the tube that it is glued to; pinned in the tube's middle.

    The graduation was ruled at 20 degC.

    extension_i = alpha s_i (T_i - 20 degC), T_i the mean of the tube's temperatures at its middle and at the reading
    head. Strength: alpha (steel 11, glass 8, aluminium 23 ppm/K).
    """

    id = "scale_expansion"
    unit = "ppm/K"
    max_strength = 23.0

    def scale_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        links = self.mechanism.link_of_scale
        pieces_K = inputs.warm.link_pieces_K[links] + (inputs.warm.zero_degC - REFERENCE_degC)
        middle = LINK_PIECES // 2
        head = middle + np.clip(inputs.scale_mm / inputs.link_mm[links] * LINK_PIECES, -middle, middle)
        places = np.arange(LINK_PIECES)
        head_K = np.array([np.interp(place, places, K) for place, K in zip(head, pieces_K, strict=True)])
        mean_K = (pieces_K[:, middle] + head_K) / 2
        return np.asarray(self.strength * PPM * inputs.scale_mm * mean_K)


class ScaleCyclic(Cause):
    """Interpolation error within the signal period p: offset, amplitude and phase errors of the quadrature signals.

    The scale shows p/(2 pi) atan2((1 + r) sin(phi + q/2) + b, cos(phi - q/2) + a), phi = 2 pi s/p
    (P. L. M. Heydemann, Applied Optics 20, 1981, 3382). Strength: amplitude of the first harmonic in um, which fixes
    sqrt(a^2 + b^2); r and q (second harmonic) are at most half of that.
    """

    id = "scale_cyclic"
    unit = "um"
    max_strength = 2.0

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self._period_mm = mechanism.geometry.scale_signal_period_mm or DEFAULT_PERIOD_MM
        # An offset of 1 of the amplitude causes an error of p / (2 pi).
        offset = strength * UM * 2 * np.pi / self._period_mm
        angle = rng.uniform(0, 2 * np.pi, mechanism.scales)
        self._offsets = offset * np.array([np.cos(angle), np.sin(angle)])
        self._unequal = 0.5 * offset * rng.uniform(-1, 1, mechanism.scales)
        self._skew_rad = 0.5 * offset * rng.uniform(-1, 1, mechanism.scales)

    def scale_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        phase = 2 * np.pi * inputs.scale_mm / self._period_mm
        cosine = np.cos(phase - self._skew_rad / 2) + self._offsets[0]
        sine = (1 + self._unequal) * np.sin(phase + self._skew_rad / 2) + self._offsets[1]
        error_rad = (np.arctan2(sine, cosine) - phase + np.pi) % (2 * np.pi) - np.pi
        return np.asarray(-error_rad * self._period_mm / (2 * np.pi))


class GaugeLatency(Cause):
    """Delay of scale displays and joint comparators, which average: the reading at t is the value at t - tau.

    Strength: tau. The history of scale and comparator values is interpolated linearly.
    """

    id = "gauge_latency"
    unit = "ms"
    max_strength = 50.0
    only_in_motion = True
    remembers_readings = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self._time_s = 0.0
        self._scale: deque[tuple[float, FloatArray]] = deque([(0.0, np.zeros(mechanism.scales))])
        self._joint: deque[tuple[float, FloatArray]] = deque()

    def pass_time(self, interval: Interval, warm: WarmUp) -> None:
        self._scale.append((self._time_s, interval.start_mm))
        self._scale.append((self._time_s + interval.travel_s, interval.end_mm))
        self._time_s += interval.time_s
        for history in (self._scale, self._joint):
            while len(history) > 2 and history[1][0] <= self._time_s - self.strength * MS:
                history.popleft()

    def scale_reading_mm(self, scale_mm: FloatArray) -> FloatArray:
        return self._delayed(self._scale, scale_mm)

    def joint_reading_mm(self, joint_mm: FloatArray) -> FloatArray:
        delayed_mm = self._delayed(self._joint, joint_mm)
        self._joint.append((self._time_s, joint_mm))
        return delayed_mm

    def _delayed(self, history: deque[tuple[float, FloatArray]], present_mm: FloatArray) -> FloatArray:
        """(m,) values `strength` ago; `present_mm`: (m,) values now."""
        states = [*history, (self._time_s, present_mm)]
        past_s = self._time_s - self.strength * MS
        after = bisect_right(states, past_s, key=itemgetter(0))
        if after in (0, len(states)):
            return states[max(after - 1, 0)][1].copy()
        (start_s, start_mm), (end_s, end_mm) = states[after - 1 : after + 1]
        return np.asarray((end_mm - start_mm) / (end_s - start_s) * (past_s - start_s) + start_mm)


class Backlash(Cause):
    """Play between scale and link: on reversal the link stays behind until the play is taken up.

    extension' = clip(extension - ds, -b_i/2, +b_i/2): a play operator (A. Visintin, Differential Models of Hysteresis,
    1994) on the scale position s. Strength: the play b; each link has 0.75 to 1.25 of it.
    """

    id = "backlash"
    unit = "um"
    min_strength = 0.1
    max_strength = 20.0

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self._play_mm = strength * UM * uniform_scatter(rng, mechanism.scales)
        self.part_strengths = self._play_mm / UM
        self._extension_mm: FloatArray = np.zeros(mechanism.scales)

    def pass_time(self, interval: Interval, warm: WarmUp) -> None:
        half_mm = self._play_mm / 2
        self._extension_mm = np.clip(self._extension_mm - (interval.end_mm - interval.start_mm), -half_mm, half_mm)

    def scale_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        return self._extension_mm


class FrictionHysteresis(Cause):
    """Friction bends the scale's mount: an Iwan chain of springs that begin to slide one after another.

    Spring k slides at the deflection y_k = d (2k + 1)/m, k = 0 .. m - 1, that is, evenly between 0 and 2 d (W. D. Iwan,
    J. Appl. Mech. 33, 1966, 893); extension = -strength * mean(bent_k / y_k). Strength: half the height of the
    saturated loop; the mean sliding distance d is drawn between 3 and 30 mm.
    """

    id = "friction_hysteresis"
    unit = "um"
    min_strength = 0.1
    max_strength = 5.0
    signed = True

    def __init__(self, strength: float, mechanism: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, mechanism, rng)
        self.distance_mm = float(np.exp(rng.uniform(np.log(3.0), np.log(30.0))))
        share = (2 * np.arange(SLIDERS) + 1) / SLIDERS
        self._yield_mm = self.distance_mm * share[:, None]
        self._bent_mm: FloatArray = np.zeros((SLIDERS, mechanism.scales))

    def pass_time(self, interval: Interval, warm: WarmUp) -> None:
        moved_mm = interval.end_mm - interval.start_mm
        self._bent_mm = np.clip(self._bent_mm + moved_mm, -self._yield_mm, self._yield_mm)

    def scale_extension_mm(self, inputs: CauseInputs) -> FloatArray:
        # stiff springs slide early, so that each carries the same force when it slides
        return np.asarray(-self.strength * UM * (self._bent_mm / self._yield_mm).mean(axis=0))


CAUSES = (ScaleGain, ScaleExpansion, ScaleCyclic, GaugeLatency, Backlash, FrictionHysteresis)
