"""The simulated machine as a whole: what it does as time passes, where its tip truly is, what its gauges see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from compd.configuration.geometry import Geometry
from compd.configuration.operation import Wiring
from compd.errors import CompdError, KinematicsError, Problem
from compd.simulation.closure import Floats, Posture, homogeneous
from compd.simulation.frame import PPM, Frame
from compd.simulation.joints import Balls, Joints
from compd.simulation.mechanism import Mechanism
from compd.simulation.motion import Follower, Phase, Tour
from compd.simulation.sensors import Sensors
from compd.simulation.strengths import Strengths
from compd.simulation.tour import STROKE_SHARE, tour_points_mm
from compd.simulation.warm_up import WarmUp
from compd.simulation.weather import Weather

DWELL_S = 1.5
# A platform that leans more than 60 degrees from its attitude at machine zero has hit something.
LEAST_UPRIGHT = 0.5

Mode = Literal["zero", "tour", "commanded", "blocked"]


@dataclass(frozen=True)
class Settled:
    """The machine in equilibrium at one instant; mm, N."""

    scale_mm: Floats
    posture: Posture
    supports_M: Floats
    plate_M: Floats
    balls: Balls
    tip_M: Floats
    tip_P: Floats


class World:
    """Starts at machine zero and stands there, unchanged, for a while; then it is switched on: it warms up
    and starts its tour. Not for two threads at once, but for `sense`."""

    def __init__(
        self, geometry: Geometry, wiring: Wiring, seed: int, speedup: float = 1.0,
        zero_hold_s: float = 0.0, strengths: Strengths | None = None,
    ) -> None:  # fmt: skip
        """`speedup`: weather and warm-up run this many times faster than the machine moves.

        `zero_hold_s`: how long it stands at machine zero; a command or a call of `tour` ends it too.
        """
        self._strengths = strengths or Strengths()
        weather_rng, joint_rng, self._tour_rng, sensor_rng = (
            np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(4)
        )
        self._speedup = speedup
        self.zero_hold_s = zero_hold_s
        self._mechanism = Mechanism(geometry)
        self._weather = Weather(self._strengths.room_swing_K, weather_rng)
        self._warm = WarmUp(self._mechanism.links, self._weather, self._strengths.heat_share)
        self._frame = Frame(self._mechanism, self._strengths)
        self._joints = Joints(self._mechanism, self._strengths, joint_rng)
        self._sensors = Sensors(geometry, wiring, self._strengths, sensor_rng)
        self._points_mm = tour_points_mm(self._mechanism, self._tour_rng)
        self._stroke_mm = STROKE_SHARE * self._mechanism.lengths0_mm
        self._drives: Tour | Follower = Follower(np.zeros(self._mechanism.links))
        self.time_s = 0.0
        self.force_M_N: Floats = np.zeros(3)
        self.mode: Mode = "zero"
        self._axial0_N, self._lateral0_M = self._forces(
            self._mechanism.posture0, self._mechanism.joints0_M, self._mechanism.joints_P
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
                self.tour()
        if time_s > 0:
            moved_s = self._drives.advance(time_s)
            self._warm.advance(time_s * self._speedup, moved_s / time_s)
            try:
                self._settled = self._settle(self._drives.position_mm, self._settled.posture)
            except KinematicsError:
                self._drives = Follower(self._settled.scale_mm)
                self.mode = "blocked"
        self._shown = self._show()

    def tour(self) -> None:
        """Visit seeded points of the workspace, dwelling at each, as a measuring machine does."""
        self._drives = Tour(self._settled.scale_mm, self._points_mm, DWELL_S, self._tour_rng)
        self.mode, self.zero_hold_s = "tour", 0.0

    def command(self, scale_mm: Sequence[float]) -> None:
        """Drive to scale values, (n,) mm, at limited speed.

        Raises CompdError for the wrong number of values, beyond the stroke or where the links cannot meet.
        """
        setpoint_mm = self._checked(scale_mm)
        self._settle(setpoint_mm, self._settled.posture)
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
    def tip_frame(self) -> str:
        """In which frame the truth is told: "M", or "P" (the place on the work) with the tool on the plate."""
        return self._mechanism.tip_frame

    @property
    def scale_mm(self) -> Floats:
        """(n,) true scale positions."""
        return self._settled.scale_mm

    @property
    def weather_time_s(self) -> float:
        """Seconds since switch-on as weather and warm-up count them."""
        return self._warm.time_s

    def tip_M_mm(self) -> Floats:
        """(3,) where the tool's tip is, in {M}."""
        return self._settled.tip_M

    def tip_P_mm(self) -> Floats:
        """(3,) the place in {P} that the tool's tip touches."""
        return self._settled.tip_P

    def tip_for(self, scale_mm: Sequence[float]) -> Floats:
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
                Problem("simulated machine", "has nothing to measure under this name", name, ", ".join(self._shown),
                        "wire a gauge to one of these")
            ) from None  # fmt: skip

    @property
    def names(self) -> list[str]:
        """Everything that can be sensed."""
        return list(self._shown)

    # --- how it comes about -------------------------------------------------------------------------

    def _show(self) -> dict[str, float]:
        settled = self._settled
        frame_mm = self._frame.comparators_mm(settled.supports_M, settled.plate_M, self._warm)
        return {
            **self._sensors.show(settled.scale_mm, settled.balls, frame_mm, self._warm.thermometers_degC()),
            "pressure_hPa": self._weather.pressure_hPa(self._warm.time_s),
            "humidity_pct": self._weather.humidity_pct(self._warm.time_s),
            **{f"force_{axis}_N": float(force) for axis, force in zip("xyz", self.force_M_N, strict=True)},
        }

    def _settle(self, scale_mm: Floats, guess: Posture) -> Settled:
        """Twice round: forces and joint angles hardly depend on the micrometres that they cause."""
        s, warm, machine = self._strengths, self._warm, self._mechanism
        stretch = s.support_expansion_ppm_per_K * PPM * warm.over_reference_K("base")
        joints_P = machine.joints_P * (1 + s.platform_expansion_ppm_per_K * PPM * warm.over_reference_K("platform"))
        # the rods between the balls and the scale (paper, figure 5) lie within the links
        rods_mm = s.scale_rod_expansion_ppm_per_K * PPM * warm.links_K * machine.lengths0_mm
        lengths_mm = machine.lengths0_mm + scale_mm + rods_mm

        supports_M = self._frame.supports_M(warm, np.zeros((3, 3)))
        base_M = machine.base_joints_M(supports_M, stretch)
        posture = machine.closure.by_lengths(base_M, joints_P, lengths_mm, guess)
        platform_M = homogeneous(joints_P) @ posture
        axial_N, lateral_M = self._forces(posture, base_M, joints_P)
        axial_N, lateral_M = axial_N - self._axial0_N, lateral_M - self._lateral0_M

        pull_M = np.zeros((3, 3))
        directions_M = (platform_M - base_M) / lengths_mm[:, None]
        np.add.at(pull_M, machine.support_of_joint, axial_N[:, None] * directions_M + lateral_M)
        supports_M = self._frame.supports_M(warm, pull_M)
        balls = self._joints.balls(posture, base_M, platform_M, axial_N, lateral_M)
        posture = machine.closure.by_lengths(
            machine.base_joints_M(supports_M, stretch) + balls.base_across_M,
            joints_P + balls.platform_across_P,
            lengths_mm + balls.base_along_mm - balls.platform_along_mm,
            posture,
        )
        if np.sum(posture[3] * machine.posture0[3]) < LEAST_UPRIGHT:
            raise KinematicsError(
                Problem("simulated machine", "the platform would tip over at these scale values",
                        np.array2string(scale_mm, precision=3), next_step="ask for a place nearer to machine zero")
            )  # fmt: skip
        return self._at(scale_mm, posture, supports_M, balls)

    def _at(self, scale_mm: Floats, posture: Posture, supports_M: Floats, balls: Balls) -> Settled:
        tool = 1 + self._strengths.tool_expansion_ppm_per_K * PPM * self._warm.over_reference_K("tool")
        on_platform = self.tip_frame == "M"
        tool_M = self._mechanism.tip0_M * (1.0 if on_platform else tool)
        tip_P = self._mechanism.tip0_P * tool if on_platform else posture[1:] @ (tool_M - posture[0])
        tip_M = homogeneous(tip_P) @ posture if on_platform else tool_M
        return Settled(scale_mm, posture, supports_M, self._frame.plate_M(self._warm), balls, tip_M, tip_P)

    def _forces(self, posture: Posture, base_M: Floats, joints_P: Floats) -> tuple[Floats, Floats]:
        machine = self._mechanism
        tip_P = machine.tip0_P
        if self.tip_frame == "P":
            tip_P = posture[1:] @ (machine.tip0_M - posture[0])
        loads = [(machine.weight_M, machine.weight_at_P), (self.force_M_N, tip_P)]
        return machine.closure.forces(posture, base_M, joints_P, loads)

    def _checked(self, scale_mm: Sequence[float]) -> Floats:
        values = np.array(scale_mm, dtype=float)
        if values.shape != (self._mechanism.links,):
            raise CompdError(
                Problem("scale_mm", "one value per link is needed", str(list(scale_mm)),
                        f"{self._mechanism.links} numbers, mm")
            )  # fmt: skip
        if not np.all(np.abs(values) <= self._stroke_mm):
            stroke = f"{self._stroke_mm.min():.1f}"
            raise CompdError(
                Problem("scale_mm", "beyond the stroke of a link", str(list(scale_mm)),
                        f"-{stroke} to {stroke} mm")
            )  # fmt: skip
        return values
