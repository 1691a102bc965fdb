"""What effects are computed from: N instants of a machine, with all readings and the nominal model's pose."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.errors import CompdError
from compd.link_count import LinkCount
from compd.model.kinematics import Actuators, Arrangement, Contact, Mechanism, link_forces
from compd.reference_conditions import standard_value, value_at_zero
from compd.rotation import to_outer

# What a machine of known kinematics gives in every recording and live: its pose with all lengths and directions, the
# scales, which way the links last moved and how fast, and the rows' order in time.
GIVEN_BY_KINEMATICS = frozenset({"kinematics", "scale", "direction", "motion", "time", "order"})

# Columns of the reference instrument and of a model: an effect computed from them would be fitted to its own answer.
ANSWER_PREFIXES = ("reference_", "model_")


class MachineDetails(NamedTuple):
    """What effects need of a machine's description beyond its kinematics; nan where it says nothing.

    plate_thickness_mm, scale_signal_period_mm, tolerance_mm: of the configuration's `geometry:`.
    link_limits_mm: shortest and longest length of a link that extends.
    instrument_M_mm: where the reference instrument's beam starts. Only the refractive index of air depends on it;
        without a place of its own the beam is taken to start at the origin of {M}.
    """

    plate_thickness_mm: float = math.nan
    scale_signal_period_mm: float = math.nan
    instrument_M_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tolerance_mm: float = math.nan
    link_limits_mm: tuple[float, float] = (math.nan, math.nan)


class AtZero(NamedTuple):
    """The machine at machine zero, where every gauge reads zero.

    base_joints_M_mm : (n, 3).  platform_origin_M_mm : (3,).  rotation_M_P : (3, 3).
    contact : tip_M_mm (3,), tip_P_mm (3,).
    link_length_mm : (n,), l0.  actuator_mm : (m,), where the actuators stand.
    distances_mm : (9,), t0_1..t0_3, u0_1..u0_6.
    """

    base_joints_M_mm: FloatArray
    platform_origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    contact: Contact
    link_length_mm: FloatArray
    actuator_mm: FloatArray
    distances_mm: FloatArray


class MachineConstants(NamedTuple):
    """What effects need of the machine beyond the readings; computed once per machine, nan where it is not described.

    platform_joints_P_mm (n, 3), revolute_axes_P (k, 3): at machine zero's temperature, unbent.  hinges (k, 2): the
    link of each axis, and whether the base carries it, as in `Mechanism`.  scale_of_link (n,): from 0.
    actuators: what moves the links; None where the kinematics is not known.
    arrangement: where the tool is; its tool_mm (3,) in {P}, or in {M} where the tool stands on the plate, as at machine
        zero.
    zero_directions_M (n, 3): unit vectors of the links at machine zero, from base to platform.
    zero_axes_M (n, 3): unit vector square to each link at machine zero, towards which its base joint's first angle
        counts: the revolute axis on a tripod, horizontal on a hexapod.
    zero_axial_force_N (n,): at machine zero with the platform's weight alone.  zero_axial_per_force (n, 3): what each
        component of an external force at the tip adds there, 1.  weight_N, weight_at_P_mm (3,): the platform's.
    frame_zero_mm (9,): t1..t3, u1..u6 at machine zero.  plate_points_M_mm (3, 3).
    plate_thickness_mm, scale_signal_period_mm.
    instrument_M_mm (3,): where the reference instrument's beam starts; the origin of {M} unless configured.
    joints : number of joint comparators.
    tolerance_mm : what plausible ranges of geometric effects rest on, beside the stroke.
    link_limits_mm : shortest and longest length of a link that extends.
    zero : the machine at machine zero; None where its kinematics is not known.
    """

    platform_joints_P_mm: FloatArray
    revolute_axes_P: FloatArray
    hinges: IntArray
    scale_of_link: IntArray
    actuators: Actuators | None
    arrangement: Arrangement
    zero_directions_M: FloatArray
    zero_axes_M: FloatArray
    zero_axial_force_N: FloatArray
    zero_axial_per_force: FloatArray
    weight_N: float
    weight_at_P_mm: FloatArray
    frame_zero_mm: FloatArray
    plate_points_M_mm: FloatArray
    plate_thickness_mm: float
    scale_signal_period_mm: float
    instrument_M_mm: FloatArray
    joints: int
    tolerance_mm: float
    link_limits_mm: tuple[float, float]
    zero: AtZero | None

    @property
    def stroke_mm(self) -> float:
        """By how much the length of a link changes at most."""
        shortest_mm, longest_mm = self.link_limits_mm
        return longest_mm - shortest_mm


@dataclass(frozen=True)
class Observations:
    """N instants of a machine; the pose is that of the nominal model, before any effect is applied.

    constants : of the machine, the same in every row.
    scale_mm (N, m), joint_mm (N, k), frame_mm (N, 9): readings, zero at machine zero.
    quantities : everything else measured, by its name with its unit, (N,) each; no column of the reference.
    time_s (N,).  session_start (N,): True where a row has no history.
    direction (N, m): +1, -1 as the scale last moved, 0 where that is not known.
    velocity_mm_per_s (N, m), joint_velocity_mm_per_s (N, k): of the readings.
    link_mm (N, n), directions_M (N, n, 3) from base to platform joint, base_joints_M_mm (N, n, 3).
    origin_M_mm (N, 3), rotation_M_P (N, 3, 3): the moving platform.  tip_M_mm (N, 3).
    recorded : of a machine without known kinematics, what of GIVEN_BY_KINEMATICS was recorded all the same.
    lacking : of a machine of known kinematics, what of GIVEN_BY_KINEMATICS these rows do not tell: of poses at rest
        without times, when and in which order they were taken.
    quantities_at_zero : the quantities when machine zero was taken, by name, from which effects count; None where they
        are not known: effects then count from the standard conditions.
    unit : of the reference, one of which counts as a um; "" where nothing says it.
    """

    constants: MachineConstants
    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, FloatArray]
    time_s: FloatArray
    session_start: BoolArray
    direction: FloatArray
    velocity_mm_per_s: FloatArray
    joint_velocity_mm_per_s: FloatArray
    link_mm: FloatArray
    directions_M: FloatArray
    base_joints_M_mm: FloatArray
    origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    tip_M_mm: FloatArray
    recorded: frozenset[str] = frozenset()
    lacking: frozenset[str] = frozenset()
    quantities_at_zero: Mapping[str, float] | None = None
    unit: str = ""

    def __post_init__(self) -> None:
        refused = [name for name in self.quantities if name.startswith(ANSWER_PREFIXES)]
        if refused:
            raise CompdError.of(
                "rows for effects",
                "an effect must never see the answer",
                value=", ".join(refused),
                allowed="measured quantities only",
                next_step="leave these columns out",
            )

    def __len__(self) -> int:
        return len(self.time_s)

    def select(self, index: IntArray | slice) -> Observations:
        """The rows of this index (R,), in its order; of a slice without a copy."""
        chosen: dict[str, Any] = {
            column.name: getattr(self, column.name)[index]
            for column in fields(self)
            if column.name not in ("constants", "quantities", "recorded", "lacking", "quantities_at_zero", "unit")
        }
        quantities = {name: values[index] for name, values in self.quantities.items()}
        return replace(self, **chosen, quantities=quantities)

    def extended_by(self, *later: Observations) -> Observations:
        """These rows and then those of the same machine, with the quantities that all have."""
        parts = (self, *later)
        joined: dict[str, Any] = {
            column.name: np.concatenate([getattr(part, column.name) for part in parts])
            for column in fields(self)
            if isinstance(getattr(self, column.name), np.ndarray)
        }
        names = [name for name in self.quantities if all(name in part.quantities for part in later)]
        quantities = {name: np.concatenate([part.quantities[name] for part in parts]) for name in names}
        return replace(self, **joined, quantities=quantities)

    @property
    def links(self) -> int:
        """n, which knows m; 0 for a machine of another model, of which only the tip is known."""
        return LinkCount(self.link_mm.shape[1], self.scale_mm.shape[1])

    @property
    def revolute_axes_P(self) -> FloatArray:
        """(k, 3)."""
        return self.constants.revolute_axes_P

    @property
    def available(self) -> set[str]:
        """Names of the quantities and settings that there are, as `unmet_needs` takes them."""
        return (set(self.quantities) | available_settings(self.constants) | self.recorded) - self.lacking

    def setting(self, name: str) -> float | None:
        """A number from the machine's description, None where it has none."""
        value = float(getattr(self.constants, name))
        return None if np.isnan(value) else value

    def quantity(self, name: str) -> FloatArray:
        """(N,). Raises CompdError where it was not measured."""
        if name not in self.quantities:
            raise CompdError.of(
                "rows for effects",
                "this quantity is not measured",
                value=name,
                allowed=", ".join(sorted(self.quantities)) or "nothing is",
                next_step="add a gauge or a column of this name",
            )
        return self.quantities[name]

    def reference_value(self, name: str) -> float:
        """From which a quantity counts: its value at machine zero, where that is not known the standard one.

        Raises CompdError where others were measured at machine zero and this one was not.
        """
        if self.quantities_at_zero is None:
            return standard_value(name)
        return value_at_zero(name, self.quantities_at_zero)

    def since_zero(self, name: str) -> FloatArray:
        """(N,) a quantity less its `reference_value`."""
        return self.quantity(name) - self.reference_value(name)

    @cached_property
    def from_standard(self) -> Observations:
        """The same rows, in which effects count from the standard conditions."""
        return replace(self, quantities_at_zero=None)

    @cached_property
    def with_quantities_at_zero(self) -> Observations:
        """The same rows, in each of which every quantity is what it was at machine zero.

        Their `axial_force_N` is that of the pose at machine zero, too: a load that hung there is in the zero.
        """
        at_zero = self.quantities_at_zero
        assert at_zero is not None, "effects count from machine zero where the quantities there are known"
        rows = replace(self, quantities={name: np.full(len(self), value) for name, value in at_zero.items()})
        if all(f"force_{axis}_N" in at_zero for axis in "xyz"):
            c = self.constants
            axial_N = c.zero_axial_force_N + c.zero_axial_per_force @ [at_zero[f"force_{axis}_N"] for axis in "xyz"]
            # where a cached property keeps its value: it is not computed from these rows' poses then
            rows.__dict__["axial_force_N"] = np.tile(axial_N, (len(self), 1))
        return rows

    def warming_K(self, place: str) -> FloatArray:
        """(N,) `temperature_<place>_degC` since machine zero; above 20 degC where that is not known."""
        return self.since_zero(f"temperature_{place}_degC")

    @cached_property
    def link_warming_K(self) -> FloatArray:
        """(N, n) each link's temperature since machine zero; above 20 degC where that is not known."""
        return np.stack([self.warming_K(f"link_{i + 1}") for i in range(self.links)], axis=1)

    @cached_property
    def force_M_N(self) -> FloatArray:
        """(N, 3) external force on what the platform carries: at the tip, on the tool or on the work."""
        return np.stack([self.quantity(f"force_{axis}_N") for axis in "xyz"], axis=1)

    @cached_property
    def force_on_tool_N(self) -> FloatArray:
        """(N, 3) force on the tool's tip, in the frame of the tool vector: {P}, or {M} for a tool on the plate."""
        return self.constants.arrangement.force_on_tool_N(self.force_M_N, self.rotation_M_P)

    @cached_property
    def axial_force_N(self) -> FloatArray:
        """(N, n) axial link forces from the external force and the platform's weight; tension is positive."""
        c = self.constants
        mechanism = Mechanism(self.base_joints_M_mm, c.platform_joints_P_mm, c.revolute_axes_P, c.hinges)
        return link_forces(
            mechanism, self.origin_M_mm, self.rotation_M_P, self.force_M_N, self.tip_M_mm, c.weight_N, c.weight_at_P_mm
        ).axial_N

    @cached_property
    def revolute_axes_M(self) -> FloatArray:
        """(N, k, 3) revolute axes as they stand now; those that the base carries as at machine zero."""
        axes_M = np.asarray(to_outer(self.rotation_M_P[:, None], np.zeros(3), self.constants.revolute_axes_P))
        on_base = self.constants.hinges[:, 1] == 1
        if on_base.any():
            axes_M[:, on_base] = self.constants.revolute_axes_P[on_base]
        return axes_M

    def of_links(self, of_scales: FloatArray) -> FloatArray:
        """Values (N, m) of the scales for each link, (N, n): those of its own scale."""
        return of_scales[:, self.constants.scale_of_link]

    @cached_property
    def joint_angles_rad(self) -> FloatArray:
        """(N, n, 2) rotation of each base joint since machine zero: towards its `zero_axes_M`, and square to that."""
        along_zero, axes = self.constants.zero_directions_M, self.constants.zero_axes_M
        along = (self.directions_M * along_zero).sum(axis=-1)
        towards_axis = (self.directions_M * axes).sum(axis=-1)
        across = (self.directions_M * np.cross(along_zero, axes)).sum(axis=-1)
        return np.stack([np.arctan2(towards_axis, along), np.arctan2(across, along)], axis=-1)


def available_settings(constants: MachineConstants) -> set[str]:
    """The settings that this machine has, of those that effects may need."""
    settings = {"revolute_axes"} if len(constants.revolute_axes_P) else set()
    if len(constants.platform_joints_P_mm):
        settings |= GIVEN_BY_KINEMATICS
    if constants.joints:
        settings.add("joint_comparators")
    if not np.isnan(constants.plate_points_M_mm).any():
        settings.add("frame_points")
    for name in ("plate_thickness_mm", "scale_signal_period_mm"):
        if not np.isnan(getattr(constants, name)):
            settings.add(name)
    return settings
