"""The part of a setpoint's error that no data can show: of motion that no reading shows yet, and of hidden faults.

The setpoint is computed again with what these channels would have shown without it. All else stays in the error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from compd.live.loop import Setpoint
from compd.live.loop.cycle import step
from compd.live.memory import Snapshot
from compd.live.memory.readings import Readings
from compd.stated_noise import tolerance_mm
from compd.units import UM_PER_MM
from tests.worlds.departure import Departure
from tests.worlds.faults.wiring import wired
from tests.worlds.tips import tip_mm
from tests.worlds.world import Told, World

# A correction follows a wrong comparator at the speed that the limits allow, and a counted one at any.
_ANY_MM_PER_S = 1e9


class Unknowable(NamedTuple):
    """left_um : the error that is counted. departed : whether the machine has moved so that no reading shows it yet."""

    left_um: float
    departed: bool


class Judge:
    """Of one world; called with every setpoint."""

    def __init__(self, world: World, due_s: Callable[[str], float]) -> None:
        """`due_s`: from a reading of a channel to the time from which the next one is overdue, s."""
        configuration = world.configuration
        scales = [channel for channel in wired(configuration) if channel.kind == "scale"]
        gauges = [configuration.gauges[channel.gauge] for channel in scales]
        names = [
            f"{gauge}.{channel.name}"
            for gauge, driver in configuration.gauge_objects().items()
            for channel in driver.channels
        ]
        self._world, self._due_s = world, due_s
        self._index = {name: index for index, name in enumerate(names)}
        self._scales = [channel.name for channel in scales]
        self._signs = np.array([channel.sign for channel in scales])
        self._at = [self._index[name] for name in self._scales]
        shows_mm = np.array([tolerance_mm(configuration.noise_of(name).um) for name in self._scales])
        acceleration = np.array([gauge.acceleration_mm_per_s2 or math.inf for gauge in gauges])
        self._departure = Departure(shows_mm, acceleration)

    def judge(self, setpoint: Setpoint, told: Told, hidden: Iterable[str], bound_um: float) -> Unknowable:
        """hidden : channels of which a fault hides at this time. bound_um : of it; below, all is counted."""
        if setpoint.inputs is None:
            return Unknowable(told.error_um, False)
        snapshot, truth = setpoint.inputs.snapshot, self._world.truth
        unseen = np.zeros(len(self._at), dtype=bool)
        if self._at:
            read_s = snapshot.readings.slots["time_s"][self._at]
            unseen = self._departure.unseen(
                told.time_s,
                told.moving,
                self._world.scale_mm(),
                np.array(truth._motion.speeds_mm_per_s),
                read_s,
                lambda: self._signs * [self._sampled(n, s) for n, s in zip(self._scales, read_s.tolist(), strict=True)],
                np.array([self._due_s(name) for name in self._scales]),
            )
        if not told.valid or not told.error_um > bound_um or not (unseen.any() or hidden):
            return Unknowable(told.error_um, bool(unseen.any()))
        return Unknowable(self._left_um(setpoint, unseen, hidden), bool(unseen.any()))

    def _sampled(self, name: str, time_s: float) -> float:
        """What a channel showed without a fault when a reading of this time (s) was sampled."""
        return self._world.sensed_at(name, time_s)

    def _left_um(self, setpoint: Setpoint, unseen: np.ndarray, hidden: Iterable[str]) -> float:
        """The error without the part of these scales and channels, which may have come into effect in part."""
        error_mm = self._world.tip_error_mm(setpoint)
        assert setpoint.inputs is not None
        slots = setpoint.inputs.snapshot.readings.slots.copy()
        for name in hidden:
            slot = slots[self._index[name]]
            true = self._sampled(name, float(slot["time_s"]))
            if math.isfinite(slot["value"]) and math.isfinite(true):
                slot["value"] = true
        true_mm = self._world.scale_mm()
        for at, name, sign, place_mm, moved in zip(
            self._at, self._scales, self._signs.tolist(), true_mm.tolist(), unseen.tolist(), strict=True
        ):
            if moved:
                slot = slots[at]
                slot["value"] += sign * place_mm - self._sampled(name, float(slot["time_s"]))
                slot["speed_mm_per_s"] = slot["braking_mm_per_s2"] = 0.0
        with_it, without = (
            self._tip_mm(setpoint, setpoint.inputs.snapshot),
            self._tip_mm(setpoint, Snapshot(setpoint.inputs.snapshot.time_s, Readings(slots.tobytes()))),
        )
        if with_it is None or without is None:
            return float(UM_PER_MM * np.linalg.norm(error_mm))
        part_mm = with_it - without
        square = float(part_mm @ part_mm)
        share = min(max(float(part_mm @ error_mm) / square, 0.0), 1.0) if square > 0.0 else 0.0
        return float(UM_PER_MM * np.linalg.norm(error_mm - share * part_mm))

    def _tip_mm(self, setpoint: Setpoint, snapshot: Snapshot) -> np.ndarray | None:
        """The tip that the loop gives for these readings, with a correction that follows at once."""
        inputs, settings = setpoint.inputs, self._world.cycle
        assert inputs is not None
        if settings is None or setpoint.state_before is None:
            return None
        limits = settings.limits.model_copy(update={"slew_mm_per_s": _ANY_MM_PER_S})
        again, _ = step(setpoint.state_before, inputs._replace(snapshot=snapshot), replace(settings, limits=limits))
        return None if again.values is None else tip_mm(again, self._world.truth.tip_frame)
