"""The simulated machine as a whole: its motion and temperatures over time, its true tip, its gauges' readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Literal

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Geometry
from compd.errors import CompdError, KinematicsError
from compd.operation_settings import Wiring
from compd.simulation.truth.cause import Cause, Interval
from compd.simulation.truth.closure import Posture
from compd.simulation.truth.equilibrium import Equilibrium, EquilibriumState
from compd.simulation.truth.follow_motion import FollowMotion, MotorCommand
from compd.simulation.truth.frame import Frame
from compd.simulation.truth.heat import HELD_TIME_CONSTANT_S
from compd.simulation.truth.joints import Joints
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.motion import (
    DRIVES,
    Approach,
    Drives,
    Phase,
    SetpointMotion,
    TourMotion,
    braking,
    standing,
)
from compd.simulation.truth.plan_motion import DWELL_S, PlanMotion
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.sensors import Sensors
from compd.simulation.truth.strengths import Strengths
from compd.simulation.truth.warm_up import Heat, WarmUp
from compd.simulation.truth.weather import STANDARD_AIR, AirAtZero, Weather
from compd.simulation.truth.workspace import draw_points_mm

# Fastest change (K/s) at a real part's thermometer: 94 W in each kilogram of steel. A part held 20 K away by a water
# jacket begins ten times as fast.
_MAX_K_PER_S = 0.2
_MAX_HELD_K_PER_S = 20.0 / HELD_TIME_CONSTANT_S

Mode = Literal["zero", "tour", "plan", "commanded", "following", "blocked"]


class World:
    """A machine that stands at machine zero for `zero_hold_s`, is then switched on, warms up and tours its workspace
    or measures planned rows.

    Not thread-safe, except for `sense`.
    """

    def __init__(
        self,
        geometry: Geometry,
        wiring: Wiring,
        seed: int,
        speedup: float = 1.0,
        zero_hold_s: float = 0.0,
        strengths: Strengths | None = None,
        causes: Sequence[Cause] = (),
        weather: Weather | None = None,
        rows: Sequence[PlannedRow] = (),
        air_at_zero: AirAtZero = STANDARD_AIR,
        drives: Drives = DRIVES,
    ) -> None:
        """seed : of joints, weather, tour and gauge noise. speedup : factor by which weather and warm-up run faster
        than the machine moves.

        zero_hold_s : time at machine zero before switch-on; a command, `start_tour` or `start_plan` ends it as well.
        causes : in addition to those in `strengths`. weather : default an air-conditioned laboratory.
        rows : measured instead of the tour. air_at_zero : of the default weather. drives : by which commands are
        followed.
        """
        self._strengths = strengths or Strengths()
        weather_rng, joint_rng, self._tour_rng, sensor_rng = (
            np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(4)
        )
        self._speedup = speedup
        self._drives = drives
        self.zero_hold_s = zero_hold_s
        self.mechanism = Mechanism(geometry)
        self._causes = tuple(causes)
        self._weather = weather or Weather(self._strengths.room_swing_K, weather_rng, air_at_zero)
        self._warm = WarmUp(self.mechanism.links, self._weather, self._strengths.heat_share)
        self._frame = Frame(self.mechanism, self._strengths)
        self._joints = Joints(self.mechanism, self._strengths, joint_rng)
        self._sensors = Sensors(geometry, wiring, self._strengths, sensor_rng)
        self._stroke_mm = self.mechanism.stroke_mm
        self._motion: TourMotion | SetpointMotion | PlanMotion | FollowMotion = SetpointMotion(
            standing(np.zeros(self.mechanism.scales)), drives
        )
        self._rows = rows
        self._unsolved_s = 0.0, 0.0  # time (s) since the last `advance`, and the part of it with moving links
        self.time_s = 0.0
        self.force_M_N: FloatArray = np.zeros(3)
        self.mode: Mode = "zero"
        self._equilibrium = Equilibrium(
            self.mechanism, self._strengths, self._frame, self._joints, self._causes, self._warm, self._weather
        )
        self._state = self._solve(self._motion.position_mm, self.mechanism.posture0)
        self._readings: Mapping[str, float] = self._read_gauges()

    # --- motion and time ----------------------------------------------------------------------------

    def advance(self, time_s: float) -> None:
        """Advance by `time_s`. Motion to a place that the links cannot reach stops before it (mode `blocked`)."""
        self.move(time_s)
        passed_s, moved_s = self._unsolved_s
        self._unsolved_s = 0.0, 0.0
        if passed_s > 0:
            try:
                self._advance_state(self._motion.position_mm, self._state.posture, passed_s, moved_s)
            except KinematicsError:
                self._motion = SetpointMotion(standing(self._state.scale_mm), self._drives)
                self.mode = "blocked"
        self._readings = self._read_gauges()

    def move(self, time_s: float) -> None:
        """Advance the motion alone by `time_s`; bending and warming up follow with the next `advance`."""
        self.time_s += time_s
        if self.mode == "zero":
            zero_s = min(time_s, self.zero_hold_s)
            self.zero_hold_s -= zero_s
            time_s -= zero_s
            if time_s > 0:
                self.start_plan() if self._rows else self.start_tour()
        if time_s > 0:
            passed_s, moved_s = self._unsolved_s
            self._unsolved_s = passed_s + time_s, moved_s + self._motion.advance(time_s)

    def advance_to(self, scale_mm: FloatArray, guess: Posture, time_s: float, travel_s: float) -> None:
        """Advance by `time_s`; in the first `travel_s` of it the links move straight to `scale_mm`, (n,).

        For campaigns, which need no state on the way. guess : a posture near the end, for Newton's method.
        Raises KinematicsError if the links cannot meet.
        """
        self.time_s += time_s
        self._advance_state(scale_mm, guess, time_s, travel_s)
        self._motion = SetpointMotion(standing(scale_mm), self._drives)
        self.mode, self.zero_hold_s = "commanded", 0.0
        self._readings = self._read_gauges()

    def wait(self, time_s: float) -> None:
        """Stand still for `time_s` while nobody looks: state and readings stay those of the last advance.

        For campaigns; the next `advance_to` finds what it would find after an `advance_to` on the spot.
        """
        if any(cause.remembers_readings for cause in self._causes):
            self.advance_to(self.scale_mm, self.posture, time_s, 0.0)
            return
        self.time_s += time_s
        self._pass_time(self.scale_mm, time_s, 0.0)
        self._sensors.skip_reading()

    def start_tour(self) -> None:
        """Visit random points of the workspace from now on, dwelling at each, as a measuring machine does."""
        self._leave_plan()
        self._motion = TourMotion(self._braking(), self._points_mm, DWELL_S, self._tour_rng)
        self.mode, self.zero_hold_s = "tour", 0.0

    def start_plan(self) -> None:
        """Visit the tour's points once, measure the planned rows, then stand still.

        The walk over the points gives `compd recording join` the motion by which it aligns two clocks. Raises
        CompdError if no rows are planned.
        """
        if not self._rows:
            raise CompdError.of("simulated machine", "nothing is planned", next_step="start it with --plan")
        self._motion = PlanMotion(self._rows, self._braking(), self.hold, self._speedup, [*self._points_mm])
        self.mode, self.zero_hold_s = "plan", 0.0

    @cached_property
    def _points_mm(self) -> FloatArray:
        """(POINTS, n) scale values at the tour's points; a campaign, which has points of its own, never asks."""
        return draw_points_mm(self.mechanism, self._tour_rng)

    @property
    def unnatural_K_per_s(self) -> float:
        """Fastest warm-up (K/s) of its parts if faster than in nature; else 0."""
        natural = _MAX_HELD_K_PER_S if self._rows else _MAX_K_PER_S
        return 0.0 if natural * self._speedup <= _MAX_K_PER_S else natural * self._speedup

    def hold(self, quantities: Mapping[str, float]) -> None:
        """Hold temperatures of parts, room, air and load on the tip at these values from now on, by name with unit.

        Quantities that are not named are not held; a load component that is not named is 0.
        """
        parts_degC = {name: degC for name, degC in quantities.items() if name.startswith("temperature_")}
        parts_degC.pop("temperature_room_degC", None)  # controlled: the weather has it
        self._warm.hold({name[len("temperature_") : -len("_degC")]: degC for name, degC in parts_degC.items()})
        self._weather.controlled = quantities
        self.force_M_N = np.array([quantities.get(f"force_{axis}_N", 0.0) for axis in "xyz"])

    def command(self, scale_mm: Sequence[float]) -> None:
        """Drive to scale values, (n,) mm, at limited speed and acceleration.

        Raises CompdError for a wrong number of values, beyond the stroke or where the links cannot meet.
        """
        setpoint_mm = self._checked(scale_mm)
        self._solve(setpoint_mm, self._state.posture)
        self._leave_plan()
        if not isinstance(self._motion, SetpointMotion):
            self._motion = SetpointMotion(self._braking(), self._drives)
        self._motion.setpoint_mm = setpoint_mm
        self.mode, self.zero_hold_s = "commanded", 0.0

    def follow(self, commands: Sequence[MotorCommand]) -> None:
        """Follow a controller's stream of commands, oldest first, without a limit of speed.

        Raises CompdError for a wrong number of values, or beyond the stroke; the machine then follows none of them.
        """
        for command in commands:
            self._checked(command.scale_mm.tolist())
        self._leave_plan()
        if not isinstance(self._motion, FollowMotion):
            self._motion = FollowMotion(self._motion.position_mm)
        self._motion.follow(commands)
        self.mode, self.zero_hold_s = "following", 0.0

    # --- true state ---------------------------------------------------------------------------------

    @property
    def phase(self) -> Phase:
        return self._motion.phase

    @property
    def point(self) -> int | None:
        """Number, from 1, of the tour's point that is visited or driven to; None outside a tour."""
        return self._motion.point

    @property
    def plan_motion(self) -> PlanMotion | None:
        """Progress through the planned rows; None while no plan is followed."""
        return self._motion if isinstance(self._motion, PlanMotion) else None

    @property
    def tip_frame(self) -> str:
        """Frame of the tip's coordinates: "M", or "P" (place on the workpiece) with the tool on the plate."""
        return self.mechanism.tip_frame

    @property
    def scale_mm(self) -> FloatArray:
        """(n,) true scale positions."""
        return self._state.scale_mm

    @property
    def weather_time_s(self) -> float:
        """Seconds since switch-on as weather and warm-up count them."""
        return self._warm.time_s

    def tip_M_mm(self) -> FloatArray:
        """(3,) the tool's tip in {M}."""
        return self._state.tip_M

    def tip_P_mm(self) -> FloatArray:
        """(3,) place in {P} that the tool's tip touches."""
        return self._state.tip_P

    def reference_tip_mm(self) -> FloatArray:
        """(3,) the tip as a reference instrument without noise shows it, in `tip_frame`."""
        return self._state.shown

    def rotation_M_P(self) -> FloatArray:
        """(3, 3) attitude of the platform: the axes of {P} in {M}, as columns."""
        return np.asarray(self._state.posture[1:].T)

    def link_change_mm(self) -> FloatArray:
        """(n,) change of the true distance between each link's joint centres since machine zero."""
        return self._state.link_mm - self.mechanism.lengths0_mm

    def axial_N(self) -> FloatArray:
        """(n,) link forces beyond those at machine zero, tension positive."""
        return self._state.axial_N

    @property
    def posture(self) -> Posture:
        return self._state.posture

    def heat(self, heat: Heat) -> None:
        """Set the heat of drives, electronics and lamps from now on."""
        self._warm.heat = heat

    def tip_for(self, scale_mm: Sequence[float]) -> FloatArray:
        """(3,) the tip, in `tip_frame`, if the scales were at these values now; the machine does not move.

        Raises CompdError as `command` does.
        """
        state = self._solve(self._checked(scale_mm), self._state.posture)
        return state.tip_M if self.tip_frame == "M" else state.tip_P

    # --- gauges -------------------------------------------------------------------------------------

    def sense(self, name: str) -> float:
        """Reading of a gauge as of the last `advance`, in its unit. Thread-safe. Raises CompdError for a name that is
        not in `names`."""
        try:
            return self._readings[name]
        except KeyError:
            raise CompdError.of(
                "simulated machine",
                "has nothing to measure under this name",
                value=name,
                allowed=", ".join(self._readings),
                next_step="wire a gauge to one of these",
            ) from None

    def sense_scale(self, name: str) -> float:
        """Reading (mm) of the scale `name`, scale_1 to scale_n, where the motion is now."""
        scale_mm = self._motion.position_mm
        for cause in self._causes:
            scale_mm = cause.scale_reading_mm(scale_mm)
        return float(self._sensors.scale_mm(scale_mm)[int(name.removeprefix("scale_")) - 1])

    def look(self) -> EquilibriumState:
        """The state at the present motion; that of the last `advance` if the links cannot meet there."""
        if self.phase == "dwelling" and np.array_equal(self._motion.position_mm, self._state.scale_mm):
            return self._state
        try:
            return self._solve(self._motion.position_mm, self._state.posture)
        except KinematicsError:
            return self._state

    def quantities(self) -> dict[str, float]:
        """Readings of thermometers, barometer, hygrometer and load cell without noise, by name."""
        return {**self._warm.thermometers_degC(), **self._air_and_load()}

    @property
    def names(self) -> list[str]:
        """Names of everything that can be sensed."""
        return list(self._readings)

    def _advance_state(self, scale_mm: FloatArray, guess: Posture, time_s: float, travel_s: float) -> None:
        """Advance temperatures and the causes' memories, then solve for the state at `scale_mm`."""
        self._pass_time(scale_mm, time_s, travel_s)
        self._state = self._solve(scale_mm, guess)

    def _pass_time(self, scale_mm: FloatArray, time_s: float, travel_s: float) -> None:
        """Advance temperatures and the causes' memories, the links on their way to `scale_mm` for `travel_s`."""
        weather_s = time_s * self._speedup
        self._warm.advance(weather_s, travel_s / time_s)
        interval = Interval(self._state.scale_mm, scale_mm, travel_s, time_s, weather_s)
        for cause in self._causes:
            cause.pass_time(interval, self._warm)

    def _braking(self) -> Approach:
        """The motion that brings the links to rest from now on."""
        return braking(self._motion.position_mm, self._motion.speeds_mm_per_s, self._drives)

    def _leave_plan(self) -> None:
        """Release what the plan holds, except for a load."""
        if self.plan_motion:
            self._warm.hold({})
            self._weather.controlled = {}

    def _solve(self, scale_mm: FloatArray, guess: Posture) -> EquilibriumState:
        return self._equilibrium.solve(scale_mm, guess, self.force_M_N)

    def _read_gauges(self) -> dict[str, float]:
        state, warm = self._state, self._warm
        scale_mm = state.scale_mm
        joint_mm = self._sensors.joint_values_mm(state.balls)
        frame_mm = self._frame.comparators_mm(state.supports_M, state.plate_M, warm)
        for cause in self._causes:
            scale_mm, joint_mm = cause.scale_reading_mm(scale_mm), cause.joint_reading_mm(joint_mm)
            frame_mm = cause.frame_reading_mm(frame_mm, warm)
        readings = self._sensors.read(scale_mm, joint_mm, frame_mm, warm.thermometers_degC())
        return {**readings, **self._air_and_load()}

    def _air_and_load(self) -> dict[str, float]:
        return {
            "pressure_hPa": self._weather.pressure_hPa(self._warm.time_s),
            "humidity_pct": self._weather.humidity_pct(self._warm.time_s),
            **{f"force_{axis}_N": float(force) for axis, force in zip("xyz", self.force_M_N, strict=True)},
        }

    def _checked(self, scale_mm: Sequence[float]) -> FloatArray:
        values = np.array(scale_mm, dtype=float)
        if values.shape != (self.mechanism.scales,):
            raise CompdError.of(
                "scale_mm",
                "one value per scale is needed",
                value=str(list(scale_mm)),
                allowed=f"{self.mechanism.scales} numbers, mm",
            )
        if not np.all(np.abs(values) <= self._stroke_mm):
            stroke = f"{self._stroke_mm.min():.1f}"
            raise CompdError.of(
                "scale_mm",
                "beyond the stroke of a link",
                value=str(list(scale_mm)),
                allowed=f"-{stroke} to {stroke} mm",
            )
        return values
