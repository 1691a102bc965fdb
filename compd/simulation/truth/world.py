"""The simulated machine as a whole: what it does as time passes, where its tip truly is, what its gauges see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from compd.arrays import FloatArray
from compd.configuration.geometry import Geometry
from compd.configuration.operation import Wiring
from compd.errors import CompdError, KinematicsError, Problem
from compd.simulation.truth.cause import Cause, Interval
from compd.simulation.truth.closure import Posture
from compd.simulation.truth.equilibrium import Equilibrium, Settled
from compd.simulation.truth.frame import Frame
from compd.simulation.truth.joints import Joints
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.motion import Follower, Phase, Tour
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.sensors import Sensors
from compd.simulation.truth.stages import DWELL_S, Measuring
from compd.simulation.truth.strengths import Strengths
from compd.simulation.truth.tour import STROKE_SHARE, tour_points_mm
from compd.simulation.truth.warm_up import Heat, WarmUp
from compd.simulation.truth.weather import Weather

Mode = Literal["zero", "tour", "plan", "commanded", "blocked"]


class World:
    """Starts at machine zero and stands there, unchanged, for a while; then it is switched on: it warms up
    and starts its tour, or measures what is planned. Not for two threads at once, but for `sense`."""

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
    ) -> None:
        """`speedup`: weather and warm-up run this many times faster than the machine moves.

        `zero_hold_s`: how long it stands at machine zero; a command, or a call of `tour` or `measure`, ends it too.
        `causes`: beyond those in `strengths`. `weather`: another than the usual one. `rows`: what to measure
        instead of the tour.
        """
        self._strengths = strengths or Strengths()
        weather_rng, joint_rng, self._tour_rng, sensor_rng = (
            np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(4)
        )
        self._speedup = speedup
        self.zero_hold_s = zero_hold_s
        self._mechanism = Mechanism(geometry)
        self._causes = tuple(causes)
        self._weather = weather or Weather(self._strengths.room_swing_K, weather_rng)
        self._warm = WarmUp(self._mechanism.links, self._weather, self._strengths.heat_share)
        self._frame = Frame(self._mechanism, self._strengths)
        self._joints = Joints(self._mechanism, self._strengths, joint_rng)
        self._sensors = Sensors(geometry, wiring, self._strengths, sensor_rng)
        self._points_mm = tour_points_mm(self._mechanism, self._tour_rng)
        self._stroke_mm = STROKE_SHARE * self._mechanism.lengths0_mm
        self._drives: Tour | Follower | Measuring = Follower(np.zeros(self._mechanism.links))
        self._rows = rows
        self.time_s = 0.0
        self.force_M_N: FloatArray = np.zeros(3)
        self.mode: Mode = "zero"
        self._equilibrium = Equilibrium(
            self._mechanism, self._strengths, self._frame, self._joints, self._causes, self._warm, self._weather
        )
        self._settled = self._settle(self._drives.position_mm, self._mechanism.posture0)
        self._shown: Mapping[str, float] = self._show()

    # --- what it does -------------------------------------------------------------------------------

    def advance(self, time_s: float) -> None:
        """Let `time_s` pass. Drives that would pull the links apart stop before it (mode `blocked`)."""
        self.time_s += time_s
        if self.mode == "zero":
            held_s = min(time_s, self.zero_hold_s)
            self.zero_hold_s -= held_s
            time_s -= held_s
            if time_s > 0:
                self.measure() if self._rows else self.tour()
        if time_s > 0:
            moved_s = self._drives.advance(time_s)
            try:
                self._stand(self._drives.position_mm, self._settled.posture, time_s, moved_s)
            except KinematicsError:
                self._drives = Follower(self._settled.scale_mm)
                self.mode = "blocked"
        self._shown = self._show()

    def carry(self, scale_mm: FloatArray, guess: Posture, time_s: float, travel_s: float) -> None:
        """Let `time_s` pass, after `travel_s` of which the links have gone straight to `scale_mm`.

        For a campaign, which does not watch the machine on its way. `guess`: a posture near the end.
        Raises KinematicsError where the links cannot meet.
        """
        self.time_s += time_s
        self._stand(scale_mm, guess, time_s, travel_s)
        self._drives = Follower(scale_mm)
        self.mode, self.zero_hold_s = "commanded", 0.0
        self._shown = self._show()

    def tour(self) -> None:
        """Visit seeded points of the workspace, dwelling at each, as a measuring machine does."""
        self._leave_plan()
        self._drives = Tour(self._settled.scale_mm, self._points_mm, DWELL_S, self._tour_rng)
        self.mode, self.zero_hold_s = "tour", 0.0

    def measure(self) -> None:
        """Visit the tour's points once, go through the planned rows, then stand still.

        The walk is for who has to lay two clocks over each other. Raises CompdError where nothing is planned.
        """
        if not self._rows:
            raise CompdError(
                Problem(where="simulated machine", what="nothing is planned", next_step="start it with --plan")
            )
        self._drives = Measuring(self._rows, self._settled.scale_mm, self.hold, self._speedup, [*self._points_mm])
        self.mode, self.zero_hold_s = "plan", 0.0

    def hold(self, quantities: Mapping[str, float]) -> None:
        """From now on hold parts of the machine, the room and the load on the tip as told, by name with unit.

        What is not named is left alone; a load that is not named is 0.
        """
        parts = {name: degC for name, degC in quantities.items() if name.startswith("temperature_")}
        parts.pop("temperature_room_degC", None)  # the weather's
        self._warm.hold({name[len("temperature_") : -len("_degC")]: degC for name, degC in parts.items()})
        self._weather.held = quantities
        self.force_M_N = np.array([quantities.get(f"force_{axis}_N", 0.0) for axis in "xyz"])

    def command(self, scale_mm: Sequence[float]) -> None:
        """Drive to scale values, (n,) mm, at limited speed.

        Raises CompdError for the wrong number of values, beyond the stroke or where the links cannot meet.
        """
        setpoint_mm = self._checked(scale_mm)
        self._settle(setpoint_mm, self._settled.posture)
        self._leave_plan()
        if not isinstance(self._drives, Follower):
            self._drives = Follower(self._settled.scale_mm)
        self._drives.setpoint_mm = setpoint_mm
        self.mode, self.zero_hold_s = "commanded", 0.0

    # --- what is true -------------------------------------------------------------------------------

    @property
    def phase(self) -> Phase:
        return self._drives.phase

    @property
    def point(self) -> int | None:
        """Number of the tour's point that is visited or driven to; None outside a tour."""
        return self._drives.point

    @property
    def measuring(self) -> Measuring | None:
        """How far the plan has come; None while none is followed."""
        return self._drives if isinstance(self._drives, Measuring) else None

    @property
    def tip_frame(self) -> str:
        """In which frame the truth is told: "M", or "P" (the place on the work) with the tool on the plate."""
        return self._mechanism.tip_frame

    @property
    def scale_mm(self) -> FloatArray:
        """(n,) true scale positions."""
        return self._settled.scale_mm

    @property
    def weather_time_s(self) -> float:
        """Seconds since switch-on as weather and warm-up count them."""
        return self._warm.time_s

    def tip_M_mm(self) -> FloatArray:
        """(3,) where the tool's tip is, in {M}."""
        return self._settled.tip_M

    def tip_P_mm(self) -> FloatArray:
        """(3,) the place in {P} that the tool's tip touches."""
        return self._settled.tip_P

    def shown_mm(self) -> FloatArray:
        """(3,) where a reference instrument without noise shows the tip, in `tip_frame`."""
        return self._settled.shown

    def link_change_mm(self) -> FloatArray:
        """(n,) by which the true distances of each link's joints have changed since machine zero."""
        return self._settled.link_mm - self._mechanism.lengths0_mm

    def axial_N(self) -> FloatArray:
        """(n,) link forces beyond those at machine zero, tension positive."""
        return self._settled.axial_N

    @property
    def mechanism(self) -> Mechanism:
        return self._mechanism

    @property
    def posture(self) -> Posture:
        return self._settled.posture

    def heat(self, heat: Heat) -> None:
        """Drives, electronics, lamps from now on."""
        self._warm.heat = heat

    def tip_for(self, scale_mm: Sequence[float]) -> FloatArray:
        """(3,) where the tip would be, in `tip_frame`, were the scales at these values now; nothing moves.

        Raises CompdError as `command` does.
        """
        settled = self._settle(self._checked(scale_mm), self._settled.posture)
        return settled.tip_M if self.tip_frame == "M" else settled.tip_P

    # --- what is seen -------------------------------------------------------------------------------

    def sense(self, name: str) -> float:
        """What a gauge shows since the last `advance`, in its unit; `names` lists them. Any thread may ask."""
        try:
            return self._shown[name]
        except KeyError:
            raise CompdError(
                Problem(
                    where="simulated machine",
                    what="has nothing to measure under this name",
                    value=name,
                    allowed=", ".join(self._shown),
                    next_step="wire a gauge to one of these",
                )
            ) from None

    @property
    def names(self) -> list[str]:
        """Everything that can be sensed."""
        return list(self._shown)

    # --- how it comes about -------------------------------------------------------------------------

    def _stand(self, scale_mm: FloatArray, guess: Posture, time_s: float, travel_s: float) -> None:
        """Let `time_s` pass, `travel_s` of it on the way to `scale_mm`, and settle there."""
        weather_s = time_s * self._speedup
        self._warm.advance(weather_s, travel_s / time_s)
        travel = Interval(self._settled.scale_mm, scale_mm, travel_s, time_s, weather_s)
        for cause in self._causes:
            cause.pass_time(travel, self._warm)
        self._settled = self._settle(scale_mm, guess)

    def _leave_plan(self) -> None:
        """What was held for the plan is held no longer; a load stays."""
        if self.measuring:
            self._warm.hold({})
            self._weather.held = {}

    def _settle(self, scale_mm: FloatArray, guess: Posture) -> Settled:
        return self._equilibrium.settle(scale_mm, guess, self.force_M_N)

    def _show(self) -> dict[str, float]:
        settled, warm = self._settled, self._warm
        scale_mm = settled.scale_mm
        joint_mm = self._sensors.joints_mm(settled.balls)
        frame_mm = self._frame.comparators_mm(settled.supports_M, settled.plate_M, warm)
        for cause in self._causes:
            scale_mm, joint_mm = cause.scale_seen(scale_mm), cause.joint_seen(joint_mm)
            frame_mm = cause.frame_seen(frame_mm, warm)
        return {
            **self._sensors.show(scale_mm, joint_mm, frame_mm, warm.thermometers_degC()),
            "pressure_hPa": self._weather.pressure_hPa(warm.time_s),
            "humidity_pct": self._weather.humidity_pct(warm.time_s),
            **{f"force_{axis}_N": float(force) for axis, force in zip("xyz", self.force_M_N, strict=True)},
        }

    def _checked(self, scale_mm: Sequence[float]) -> FloatArray:
        values = np.array(scale_mm, dtype=float)
        if values.shape != (self._mechanism.links,):
            raise CompdError(
                Problem(
                    where="scale_mm",
                    what="one value per link is needed",
                    value=str(list(scale_mm)),
                    allowed=f"{self._mechanism.links} numbers, mm",
                )
            )
        if not np.all(np.abs(values) <= self._stroke_mm):
            stroke = f"{self._stroke_mm.min():.1f}"
            raise CompdError(
                Problem(
                    where="scale_mm",
                    what="beyond the stroke of a link",
                    value=str(list(scale_mm)),
                    allowed=f"-{stroke} to {stroke} mm",
                )
            )
        return values
