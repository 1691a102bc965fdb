"""Motor commands along a program, and the distance of the true tip from the programmed one."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, rms
from compd.simulation import Mechanism
from compd.units import UM_PER_MM

# Time (s) of constant nominal commands for a machine at rest.
REST_S = 0.4
SAME_MM = 1e-6


class MotionSample(NamedTuple):
    """One line of motion.log; machine_link.py says what is in it."""

    time_s: float
    nominal_mm: FloatArray
    drive_mm: FloatArray
    tip_mm: FloatArray | None
    watched: bool
    inhibited: bool
    reading: bool
    largest_mm: float
    step_mm: float


class TipErrors(NamedTuple):
    """Distance of the true tip from the programmed one, along a program.

    time_s : (N,) since the program began. error_um : (N,). at_rest : (N,) whether the commands stood still.
    """

    time_s: FloatArray
    error_um: FloatArray
    at_rest: BoolArray

    @property
    def at_rest_um(self) -> FloatArray:
        return self.error_um[self.at_rest]

    @property
    def moving_um(self) -> FloatArray:
        return self.error_um[~self.at_rest]

    def summary(self) -> list[str]:
        """rms and largest in um, at rest and on the move; "-" where the program has none of these."""
        return [
            f"{value(errors_um):.2f}" if len(errors_um) else "-"
            for errors_um in (self.at_rest_um, self.moving_um)
            for value in (rms, np.max)
        ]


def read_motion_log(path: Path, start_s: float = -np.inf, end_s: float = np.inf) -> list[MotionSample]:
    """The whole lines of a log from `start_s` to `end_s`, CLOCK_MONOTONIC; the last may not be written yet."""
    text = path.read_text()
    samples = []
    for line in text[: text.rfind("\n") + 1].splitlines():
        time_s, nominal_mm, drive_mm, tip_mm, *others = json.loads(line)
        if start_s <= time_s <= end_s:
            tip = None if tip_mm is None else np.array(tip_mm)
            samples.append(MotionSample(time_s, np.array(nominal_mm), np.array(drive_mm), tip, *others))
    return samples


def wanted_tips_mm(mechanism: Mechanism, nominal_mm: Iterable[FloatArray]) -> list[FloatArray]:
    """The programmed tip: its position with these scale values, all parts as drawn.

    Follows the hexapod from one place to the next, from machine zero or near it.
    """
    posture, tips_mm = mechanism.posture0, []
    for scale_mm in nominal_mm:
        lengths_mm = mechanism.lengths0_mm + scale_mm
        posture = mechanism.closure.by_lengths(mechanism.joints0_M, mechanism.joints_P, lengths_mm, posture)
        tips_mm.append(posture[0] + mechanism.tip0_P @ posture[1:])
    return tips_mm


def tip_errors(mechanism: Mechanism, samples: Sequence[MotionSample]) -> TipErrors:
    """Samples with the true tip, except those during a held feed, when the program stood."""
    with_tip = [number for number, sample in enumerate(samples) if sample.tip_mm is not None and not sample.inhibited]
    wanted_mm = wanted_tips_mm(mechanism, (samples[number].nominal_mm for number in with_tip))
    true_mm = np.array([samples[number].tip_mm for number in with_tip]).reshape(-1, 3)
    time_s = np.array([samples[number].time_s for number in with_tip])
    return TipErrors(
        time_s - samples[0].time_s if samples else time_s,
        np.linalg.norm(true_mm - np.reshape(wanted_mm, (-1, 3)), axis=1) * UM_PER_MM,
        _at_rest(samples)[with_tip],
    )


def _at_rest(samples: Sequence[MotionSample]) -> BoolArray:
    """(N,) whether the commands have been the same for REST_S."""
    rest = np.zeros(len(samples), dtype=bool)
    since_s = np.inf
    for number, sample in enumerate(samples):
        before = samples[number - 1] if number else sample
        if number == 0 or np.abs(sample.nominal_mm - before.nominal_mm).max() > SAME_MM:
            since_s = sample.time_s
        rest[number] = sample.time_s - since_s >= REST_S
    return rest
