"""A measuring campaign on the simulated machine, without wires and without waiting: rows of a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from compd.configuration.geometry import Geometry
from compd.configuration.operation import Wiring
from compd.simulation.apparent import Apparent
from compd.simulation.cause import Cause
from compd.simulation.closure import Floats, Posture
from compd.simulation.instruments import Kind, noisy
from compd.simulation.motion import ACCELERATION_MM_PER_S2, Move
from compd.simulation.plan import (
    PASS_MM,
    PASS_ROW_EVERY_S,
    PASS_ROWS,
    REPEAT_AFTER_S,
    VISIT_S,
    Item,
    Plan,
    switched_off,
)
from compd.simulation.strengths import Strengths
from compd.simulation.touch import TOUCH_STEP_S, approach, posture_at_scales
from compd.simulation.world import World

# Between sessions time passes in steps, for causes that remember.
LONGEST_WAIT_S = 300.0
UM = 1e-3


@dataclass
class Rows:
    """What was written down, by column of a recording; `apparent_mm`: where the gauges take the tip to be."""

    columns: dict[str, list[float]] = field(default_factory=dict)
    apparent_mm: list[Floats] = field(default_factory=list)
    reference_mm: list[Floats] = field(default_factory=list)

    def add(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.columns.setdefault(name, []).append(value)

    def error_um(self) -> float:
        """Root mean square per coordinate of what the reference shows beyond the gauges."""
        wrong = np.array(self.reference_mm) - np.array(self.apparent_mm)
        return float(np.sqrt(np.mean(wrong**2)) / UM)


class Campaign:
    """One run of a plan on one machine."""

    def __init__(
        self, geometry: Geometry, wiring: Wiring, plan: Plan, seed: int, strengths: Strengths,
        causes: Sequence[Cause] = (), *, reference: Kind = "tracker", sigma_um: float = 0.0,
        outlier_share: float = 0.0, balls_M: Floats | None = None,
    ) -> None:  # fmt: skip
        """`seed`: joints and noise follow from it. `sigma_um`: of the reference, 0 for the truth itself.

        `balls_M`: (points, 3) mm, for a ball plate the balls that are touched at the plan's points.
        """
        weather = plan.weather
        self._world = World(geometry, wiring, seed, strengths=strengths, causes=causes, weather=weather)
        self._world.heat(plan.items[0].heat)
        self._mechanism = self._world.mechanism
        self._plan = plan
        self._rng = np.random.default_rng([seed, 2, plan.number])
        self._reference, self._sigma_um, self._outlier_share = reference, sigma_um, outlier_share
        self._balls_M = balls_M
        self._direction = np.ones(self._mechanism.links)
        self._apparent = Apparent(self._mechanism, wiring) if sigma_um == 0 else None
        self._postures = [posture_at_scales(self._mechanism, scale_mm) for scale_mm in plan.points_mm]
        self._visit = 0
        self._rows = Rows()

    def run(self) -> Rows:
        """Raises KinematicsError where a point cannot be reached."""
        session = self._plan.items[0].session
        for item in self._plan.items:
            if item.session != session:
                session = item.session
                self._world.heat(switched_off(self._mechanism.links))
                self._world.force_M_N = np.zeros(3)
            self._wait_until(item.start_s)
            self._world.heat(item.heat)
            self._world.force_M_N = item.force_M_N
            if item.kind == "visit":
                self._go_to(item)
                self._note(item, item.point)
                if item.repeated:
                    self._stay(REPEAT_AFTER_S)
                    self._note(item, item.point)
            else:
                self._pass(item)
        return self._rows

    # --- moving ---------------------------------------------------------------------------------------

    def _wait_until(self, time_s: float) -> None:
        while time_s - self._world.time_s > 1e-9:
            self._stay(min(time_s - self._world.time_s, LONGEST_WAIT_S))

    def _stay(self, time_s: float) -> None:
        self._world.carry(self._world.scale_mm, self._world.posture, time_s, 0.0)

    def _go_to(self, item: Item) -> None:
        """Arrive and settle; a visit's row is written before the next one sets out."""
        self._visit += 1
        guess = self._postures[item.point - 1]
        self._move(self._plan.points_mm[item.point - 1], guess, VISIT_S - 2 * REPEAT_AFTER_S)
        if self._balls_M is not None:
            ball_M = noisy(self._balls_M[item.point - 1], self._sigma_um, self._rng, self._outlier_share)
            for scale_mm in approach(self._world, ball_M, guess):
                self._move(scale_mm, guess, TOUCH_STEP_S)

    def _move(self, scale_mm: Floats, guess: Posture, time_s: float) -> None:
        moved = scale_mm - self._world.scale_mm
        self._direction = np.where(moved != 0, np.sign(moved), self._direction)
        travel_s = Move(self._world.scale_mm, scale_mm).duration_s
        self._world.carry(scale_mm, guess, max(time_s, travel_s), travel_s)

    def _pass(self, item: Item) -> None:
        """Out towards another point and half the way back, with rows at rest and at constant speed."""
        start = self._world.scale_mm
        way = self._plan.points_mm[item.towards - 1] - start
        out = way * min(1.0, PASS_MM / np.abs(way).max())
        self._visit += 1
        self._note(item, None)
        for end in (start + out, start + out / 2):
            move = Move(self._world.scale_mm, end, item.speed_mm_per_s)
            self._direction = np.sign(end - self._world.scale_mm)
            steady_s = move.duration_s - 2 * item.speed_mm_per_s / ACCELERATION_MM_PER_S2
            every_s = min(PASS_ROW_EVERY_S, steady_s / PASS_ROWS)
            times = move.duration_s / 2 + every_s * (np.arange(PASS_ROWS) - (PASS_ROWS - 1) / 2)
            before_s = 0.0
            for time_s in [*times.tolist(), move.duration_s + 0.1]:
                step_s = time_s - before_s
                self._world.carry(move.position_mm(time_s), self._world.posture, step_s, step_s)
                before_s = time_s
                self._visit += 1
                self._note(item, None)

    # --- writing down ---------------------------------------------------------------------------------

    def _note(self, item: Item, point: int | None) -> None:
        world = self._world
        shown = {name: world.sense(name) for name in world.names}
        links = range(1, self._mechanism.links + 1)
        joints = [name for name in shown if name.startswith("joint_")]
        frames = [name for name in shown if name.startswith("frame_")]
        others = [name for name in shown if name.startswith(("temperature_", "pressure_", "humidity_", "force_"))]
        self._rows.add(
            {
                "time_s": round(world.time_s, 6),
                "session": item.session,
                "point": np.nan if point is None else point,
                "visit": self._visit,
                **{f"scale_{i}_mm": shown[f"scale_{i}"] for i in links},
                **{f"{name}_um": shown[name] / UM for name in (*joints, *frames)},
                **{name: round(shown[name], 3) for name in others},
                **{f"approach_{i}": self._direction[i - 1] for i in links},
                **self._measured(point),
            }
        )
        if self._apparent is not None:
            self._rows.apparent_mm.append(self._apparent.tip(shown, world.posture))
            self._rows.reference_mm.append(world.shown_mm())

    def _measured(self, point: int | None) -> dict[str, float]:
        if self._reference == "ball_plate":
            return {"ball": np.nan if point is None else point}
        if self._reference == "interferometer":
            changes = noisy(self._world.link_change_mm(), self._sigma_um, self._rng, self._outlier_share)
            return {f"reference_link_{i + 1}_mm": round(value, 6) for i, value in enumerate(changes.tolist())}
        tip = noisy(self._world.shown_mm(), self._sigma_um, self._rng, self._outlier_share)
        return {f"reference_{axis}_mm": round(value, 6) for axis, value in zip("xyz", tip.tolist(), strict=True)}
