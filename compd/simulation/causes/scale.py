"""Causes between a linear scale's number and the length that it stands for."""

from __future__ import annotations

from collections import deque

import numpy as np

from compd.arrays import FloatArray
from compd.simulation.truth.cause import PPM, UM, Cause, CauseInputs, Interval, Values, alike, parts
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.warm_up import LINK_PIECES, WarmUp

MS = 1e-3
# Without a period in the drawing: that of the usual exposed scale.
USUAL_PERIOD_MM = 0.020
# Elements of an Iwan chain: enough that the loop is smooth.
SLIDERS = 8


class ScaleGain(Cause):
    """The tape was stretched in its mount, or ruled by a long ruling engine: each scale by its own share."""

    id, unit, most, signed = "scale_gain", "ppm", 50.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._ppm = strength * parts(rng, machine.links)

    @property
    def values(self) -> Values:
        return tuple(self._ppm.tolist())

    def link_mm(self, now: CauseInputs) -> FloatArray:
        return np.asarray(PPM * self._ppm * now.scale_mm)


class ScaleExpansion(Cause):
    """The tape grows with the tube that it is glued to, from where it is pinned in the tube's middle.

    What counts is the tube's temperature over the travelled part: from the middle to where the head is.
    """

    id, unit, most = "scale_expansion", "ppm/K", 23.0

    def link_mm(self, now: CauseInputs) -> FloatArray:
        pieces_K = now.warm.link_pieces_K
        middle = LINK_PIECES // 2
        head = middle + np.clip(now.scale_mm / now.link_mm * LINK_PIECES, -middle, middle)
        at = np.arange(LINK_PIECES)
        head_K = np.array([np.interp(h, at, K) for h, K in zip(head, pieces_K, strict=True)])
        mean_K = (pieces_K[:, middle] + head_K) / 2
        return np.asarray(self.strength * PPM * now.scale_mm * mean_K)


class ScaleCyclic(Cause):
    """Two signals that are not quite sine and cosine, interpolated as if they were (Heydemann 1981)."""

    id, unit, most = "scale_cyclic", "um", 2.0

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._period_mm = machine.geometry.scale_signal_period_mm or USUAL_PERIOD_MM
        # an offset of 1 part of the amplitude errs by p / 2 pi; strength is the first harmonic's amplitude
        part = strength * UM * 2 * np.pi / self._period_mm
        angle = rng.uniform(0, 2 * np.pi, machine.links)
        self._offsets = part * np.array([np.cos(angle), np.sin(angle)])
        self._unequal = 0.5 * part * rng.uniform(-1, 1, machine.links)
        self._skew_rad = 0.5 * part * rng.uniform(-1, 1, machine.links)

    def link_mm(self, now: CauseInputs) -> FloatArray:
        phase = 2 * np.pi * now.scale_mm / self._period_mm
        cosine = np.cos(phase - self._skew_rad / 2) + self._offsets[0]
        sine = (1 + self._unequal) * np.sin(phase + self._skew_rad / 2) + self._offsets[1]
        shown = np.arctan2(sine, cosine)
        wrong_rad = (shown - phase + np.pi) % (2 * np.pi) - np.pi
        return np.asarray(-wrong_rad * self._period_mm / (2 * np.pi))


class GaugeLatency(Cause):
    """Scale displays and comparators average: what they show is where things were a moment ago."""

    id, unit, most, in_motion = "gauge_latency", "ms", 50.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._time_s = 0.0
        self._scale: deque[tuple[float, FloatArray]] = deque([(0.0, np.zeros(machine.links))])
        self._joint: deque[tuple[float, FloatArray]] = deque()

    def pass_time(self, travel: Interval, warm: WarmUp) -> None:
        self._scale.append((self._time_s, travel.start_mm))
        self._scale.append((self._time_s + travel.travel_s, travel.end_mm))
        self._time_s += travel.time_s
        for history in (self._scale, self._joint):
            while len(history) > 2 and history[1][0] <= self._time_s - self.strength * MS:
                history.popleft()

    def scale_seen(self, scale_mm: FloatArray) -> FloatArray:
        return self._delayed(self._scale, scale_mm)

    def joint_seen(self, joint_mm: FloatArray) -> FloatArray:
        seen = self._delayed(self._joint, joint_mm)
        self._joint.append((self._time_s, joint_mm))
        return seen

    def _delayed(self, history: deque[tuple[float, FloatArray]], now_mm: FloatArray) -> FloatArray:
        times = np.array([time_s for time_s, _ in history] + [self._time_s])
        values = np.array([value for _, value in history] + [now_mm])
        then_s = self._time_s - self.strength * MS
        return np.array([np.interp(then_s, times, column) for column in values.T])


class Backlash(Cause):
    """Play between scale and link: the link stays behind until the play is taken up, the whole way of it."""

    id, unit, least, most = "backlash", "um", 0.1, 20.0

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self._play_mm = strength * UM * alike(rng, machine.links)
        self._behind_mm: FloatArray = np.zeros(machine.links)

    @property
    def values(self) -> Values:
        return tuple((self._play_mm / UM).tolist())

    def pass_time(self, travel: Interval, warm: WarmUp) -> None:
        half = self._play_mm / 2
        self._behind_mm = np.clip(self._behind_mm - (travel.end_mm - travel.start_mm), -half, half)

    def link_mm(self, now: CauseInputs) -> FloatArray:
        return self._behind_mm


class FrictionHysteresis(Cause):
    """Friction bends what carries the scale: an Iwan chain of springs that begin to slide one after another.

    The distances from unbent to sliding lie evenly between 0 and twice the mean (W. D. Iwan, J. Appl. Mech.
    33, 1966, 893): the loop is round, where one spring's would have a corner.
    """

    id, unit, least, most, signed = "friction_hysteresis", "um", 0.1, 5.0, True

    def __init__(self, strength: float, machine: Mechanism, rng: np.random.Generator) -> None:
        super().__init__(strength, machine, rng)
        self.distance_mm = float(np.exp(rng.uniform(np.log(3.0), np.log(30.0))))
        share = (2 * np.arange(SLIDERS) + 1) / SLIDERS
        self._yield_mm = self.distance_mm * share[:, None]
        self._bent_mm: FloatArray = np.zeros((SLIDERS, machine.links))

    def pass_time(self, travel: Interval, warm: WarmUp) -> None:
        moved = travel.end_mm - travel.start_mm
        self._bent_mm = np.clip(self._bent_mm + moved, -self._yield_mm, self._yield_mm)

    def link_mm(self, now: CauseInputs) -> FloatArray:
        # stiff springs slide early: each carries the same force when it slides
        return np.asarray(-self.strength * UM * (self._bent_mm / self._yield_mm).mean(axis=0))


CAUSES = (ScaleGain, ScaleExpansion, ScaleCyclic, GaugeLatency, Backlash, FrictionHysteresis)
