"""A linear delta as controllers of printers and mills know it: three upright towers, and an arm from each to one point.

A tower i stands at t_i, on a circle of radius R at an angle. Its carriage, for the tip at p, is at the height
H_i(p) = p_z + a p_x + b p_y + sqrt(L_i^2 - |t_i - p|^2), with both places in the plane; a and b are the tilt. It is an
equation of six rods with equal pairs, joints at equal heights and parallel rails. Of any other machine it is an
approximation: its numbers are fitted to the machine over a workspace, and what is left is the error at the tip.

Each arm is the hypotenuse over its way in the plane; Klipper, RepRapFirmware and LinuxCNC compute this equation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from compd.arrays import FloatArray, IntArray
from compd.errors import CompdError
from compd.machine_reach import machine_reach
from compd.model import MachineModel, effect_deltas, observe, predict, sum_deltas
from compd.model.kinematics import Movement
from compd.units import UM_PER_MM

# A rail is upright within this angle; no controller knows another one.
_UPRIGHT_RAD = math.radians(5.0)
# The default workspace: within this share of the shortest way along x and y, and along z of a way no longer than that.
_SHARE = 0.6
_RINGS, _SPOKES, _LEVELS = 4, 12, 4


class DeltaForm(NamedTuple):
    """What a controller's settings of a delta can hold.

    title : for people.  axes : the controller's names of its towers.  angles_deg : where it has them, counter-clockwise
    from +x, unless corrected.  own_arms, own_angles : whether each tower has its own arm and its own angle.  tilt :
    whether a and b can be set.
    """

    title: str
    axes: tuple[str, str, str]
    angles_deg: tuple[float, float, float]
    own_arms: bool
    own_angles: bool
    tilt: bool


FORMS: Mapping[str, DeltaForm] = {
    "klipper": DeltaForm("Klipper", ("a", "b", "c"), (210.0, 330.0, 90.0), True, True, False),
    "reprapfirmware": DeltaForm("RepRapFirmware", ("X", "Y", "Z"), (210.0, 330.0, 90.0), True, True, True),
    "linuxcnc": DeltaForm("LinuxCNC lineardeltakins", ("0", "1", "2"), (90.0, 210.0, 330.0), False, False, False),
}


class DeltaSettings(NamedTuple):
    """A delta's numbers in the order of a controller's towers.

    actuators : which actuator of the machine each tower is, from 0.  signs : 1 where its scale counts up.
    radius_mm, arm_mm (3,), angle_deg (3,).
    endstop_mm : (3,) heights H of the carriages where the endstops are, above the controller's z 0.
    endstop_scale_mm : (3,) readings of the machine's scales there.
    tilt : (2,) a and b, 1.  gains : (3,) true way of a carriage over what its scale or its steps say.
    shift_M_mm : (3,) the controller's origin in {M}.  turn_rad : of its x axis about z of {M}.
    rms_um, worst_um : error of the tip over the workspace, by all that the settings cannot hold.
    radius_of_workspace_mm, heights_M_mm : the workspace, around the controller's origin.
    """

    form: DeltaForm
    actuators: IntArray
    signs: FloatArray
    radius_mm: float
    arm_mm: FloatArray
    angle_deg: FloatArray
    endstop_mm: FloatArray
    endstop_scale_mm: FloatArray
    tilt: FloatArray
    gains: FloatArray
    shift_M_mm: FloatArray
    turn_rad: float
    rms_um: float
    worst_um: float
    radius_of_workspace_mm: float
    heights_M_mm: tuple[float, float]

    def heights_mm(self, tip_M_mm: FloatArray) -> FloatArray:
        """(N, 3) where the controller puts its carriages for the tip at places (N, 3) in {M}."""
        cosine, sine = math.cos(self.turn_rad), math.sin(self.turn_rad)
        x, y, z = (tip_M_mm - self.shift_M_mm).T
        x, y = cosine * x + sine * y, cosine * y - sine * x
        towers = self.radius_mm * np.stack([np.cos(angles := np.deg2rad(self.angle_deg)), np.sin(angles)])
        level2 = self.arm_mm**2 - (x[:, None] - towers[0]) ** 2 - (y[:, None] - towers[1]) ** 2
        return np.asarray((z + self.tilt[0] * x + self.tilt[1] * y)[:, None] + np.sqrt(level2))

    def scales_mm(self, tip_M_mm: FloatArray) -> FloatArray:
        """(N, 3) the machine's scales, in its own order, where the controller brings the tip to places (N, 3)."""
        ways_mm = (self.heights_mm(tip_M_mm) - self.endstop_mm) / self.gains
        scales_mm = np.empty_like(ways_mm)
        scales_mm[:, self.actuators] = self.endstop_scale_mm + self.signs * ways_mm
        return scales_mm


def delta_settings(
    model: MachineModel,
    form: DeltaForm,
    bed_M_mm: float = 0.0,
    endstop_scale_mm: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> DeltaSettings:
    """The settings with which a controller's tip errs least on a machine with its effects, by least squares.

    bed_M_mm : height of the controller's z 0 in {M}.  endstop_scale_mm : readings of scales 1 to 3 at the endstops.
    Gains are fitted where the machine has effects at its scales. Origin and turn are fitted: where a controller stands
    about z of {M} is its own business, and its towers are on one circle about its origin.

    Raises CompdError where the machine is no linear delta with upright rails.
    """
    _check(model)
    tips_M_mm, scale_mm, radius_mm, levels_mm = _workspace(model)
    start = _drawn(model, form, bed_M_mm, np.array(endstop_scale_mm))
    gained = any("scale" in fitted.effect.ports for fitted in model.effects)

    def settings(numbers: FloatArray) -> DeltaSettings:
        return _set(start, numbers, gained)

    def residuals_mm(numbers: FloatArray) -> FloatArray:
        tried = settings(numbers)
        heights = tried.heights_mm(tips_M_mm)
        ways = tried.signs * (scale_mm[:, tried.actuators] - tried.endstop_scale_mm)
        return np.asarray(heights - tried.endstop_mm - tried.gains * ways).ravel()

    found = least_squares(residuals_mm, _numbers(start, gained), x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    best = settings(found.x)
    error_um = (_tips_M_mm(model, best.scales_mm(tips_M_mm)) - tips_M_mm) * UM_PER_MM
    distance_um = np.sqrt((error_um**2).sum(axis=1))
    return best._replace(
        rms_um=float(np.sqrt((distance_um**2).mean())),
        worst_um=float(distance_um.max()),
        radius_of_workspace_mm=radius_mm,
        heights_M_mm=levels_mm,
    )


def _check(model: MachineModel) -> None:
    """Raise CompdError where the machine is no linear delta."""
    kinds, along = model.actuators.kinds, model.actuators.cosine_M
    slides = len(kinds) == 3 and bool((kinds == 1).all()) and not len(model.hinges)
    upright = slides and bool((np.abs(along[:, 2]) > math.cos(_UPRIGHT_RAD)).all())
    down = upright and bool((_offsets_M_mm(model)[:, 2] > 0).all())
    if not down:
        what = "the platform does not hang below the carriages" if upright else "is no linear delta with upright rails"
        raise CompdError.of(
            "machine",
            what,
            allowed="three actuators that slide along z of {M}, six rods, the platform below the carriages",
            next_step="`--as csv` writes the numbers of any machine",
        )


def _offsets_M_mm(model: MachineModel) -> FloatArray:
    """(n, 3) from the tip to where each rod's carriage joint would be if the platform were a point, at machine zero."""
    zero = model.zero
    arms_M_mm = (model.platform_joints_P_mm - zero.contact.tip_P_mm) @ zero.rotation_M_P.T
    return np.asarray(zero.base_joints_M_mm - arms_M_mm - zero.contact.tip_M_mm)


def _workspace(model: MachineModel) -> tuple[FloatArray, FloatArray, float, tuple[float, float]]:
    """Tips (N, 3) in {M} with the scales (N, 3) there, on rings at several heights; their radius, and the heights."""
    ways = machine_reach(model).ways
    radius_mm = _SHARE * min(way.reach for way in ways if way.coordinate in "xy")
    low, high = (
        sign * min(_SHARE * way.reach, radius_mm)
        for sign in (-1, 1)
        for way in ways
        if (way.coordinate, way.sign) == ("z", sign)
    )
    radii = radius_mm * np.arange(_RINGS + 1) / _RINGS
    angles = 2 * np.pi * np.arange(_SPOKES) / _SPOKES
    plane = np.array([(r * math.cos(a), r * math.sin(a)) for r in radii for a in (angles if r else angles[:1])])
    places = np.array([(x, y, z) for z in np.linspace(low, high, _LEVELS) for x, y in plane])
    zero_M_mm = model.zero.contact.tip_M_mm
    reached = model.reach(zero_M_mm + places)
    scale_mm = reached.scale_mm[reached.pose.reason == 0]
    return _tips_M_mm(model, scale_mm), scale_mm, radius_mm, (float(zero_M_mm[2] + low), float(zero_M_mm[2] + high))


def _tips_M_mm(model: MachineModel, scale_mm: FloatArray) -> FloatArray:
    """(N, 3) where the tip is with the scales (N, 3) at these readings, by the machine with its effects."""
    assert model.constants is not None
    joint_mm = np.zeros((len(scale_mm), model.joint_weights.shape[1]))
    rows = observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=np.zeros((len(scale_mm), 9)),
        quantities={},
        time_s=np.arange(float(len(scale_mm))),
        session_start=np.ones(len(scale_mm), dtype=bool),
        movement=Movement.unknown(scale_mm, joint_mm),
    )
    return predict(model, rows, sum_deltas([effect_deltas(fitted, rows)[0] for fitted in model.effects])).tip_mm


def _drawn(model: MachineModel, form: DeltaForm, bed_M_mm: float, endstop_scale_mm: FloatArray) -> DeltaSettings:
    """The settings by the averages of each pair of rods, as a start."""
    of_link, zero_M_mm = model.actuators.of_link, model.zero.contact.tip_M_mm
    offsets = np.array([_offsets_M_mm(model)[of_link == i].mean(axis=0) for i in range(3)])
    arms = np.array([model.zero.link_length_mm[of_link == i].mean() for i in range(3)])
    angles = np.rad2deg(np.arctan2(offsets[:, 1], offsets[:, 0])) % 360.0
    # the controller's first tower may be any of the three: the one that turns it least
    orders = [np.roll(np.argsort(angles), k) for k in range(3)]
    nominal = np.array(form.angles_deg)
    ranked = np.argsort(np.argsort(nominal))
    turns = [_mean_turn_deg(angles[order][ranked], nominal) for order in orders]
    best = int(np.argmin(np.abs(turns)))
    actuators = orders[best][ranked]
    signs = np.sign(model.actuators.cosine_M[actuators, 2])
    shift = np.array([*zero_M_mm[:2], bed_M_mm])
    endstops = endstop_scale_mm[actuators]
    return DeltaSettings(
        form=form,
        actuators=actuators.astype(np.int64),
        signs=signs,
        radius_mm=float(np.hypot(offsets[:, 0], offsets[:, 1]).mean()),
        arm_mm=arms[actuators] if form.own_arms else np.full(3, arms.mean()),
        angle_deg=nominal + (_turns_deg(angles[actuators], nominal) if form.own_angles else 0.0),
        endstop_mm=offsets[actuators, 2] + zero_M_mm[2] - bed_M_mm + signs * endstops,
        endstop_scale_mm=endstops,
        tilt=np.zeros(2),
        gains=np.ones(3),
        shift_M_mm=shift,
        turn_rad=0.0 if form.own_angles else math.radians(turns[best]),
        rms_um=math.nan,
        worst_um=math.nan,
        radius_of_workspace_mm=math.nan,
        heights_M_mm=(math.nan, math.nan),
    )


def _turns_deg(angles: FloatArray, nominal: FloatArray) -> FloatArray:
    return np.asarray((angles - nominal + 180.0) % 360.0 - 180.0)


def _mean_turn_deg(angles: FloatArray, nominal: FloatArray) -> float:
    return float(_turns_deg(angles, nominal).mean())


def _numbers(settings: DeltaSettings, gained: bool) -> FloatArray:
    """What is fitted, as one vector; `_set` puts it back."""
    form = settings.form
    return np.concatenate(
        [
            [settings.radius_mm, *settings.shift_M_mm[:2]],
            settings.endstop_mm,
            settings.arm_mm if form.own_arms else settings.arm_mm[:1],
            np.deg2rad(settings.angle_deg) if form.own_angles else [settings.turn_rad],
            settings.tilt if form.tilt else [],
            settings.gains if gained else [],
        ]
    )


def _set(settings: DeltaSettings, numbers: FloatArray, gained: bool) -> DeltaSettings:
    form = settings.form
    sizes = [1, 2, 3, 3 if form.own_arms else 1, 3 if form.own_angles else 1, 2 * form.tilt, 3 * gained]
    radius, shift, endstops, arms, angles, tilt, gains = np.split(numbers, np.cumsum(sizes)[:-1])
    return settings._replace(
        radius_mm=float(radius[0]),
        shift_M_mm=np.array([*shift, settings.shift_M_mm[2]]),
        endstop_mm=endstops,
        arm_mm=np.broadcast_to(arms, 3).copy(),
        angle_deg=np.rad2deg(angles) if form.own_angles else settings.angle_deg,
        turn_rad=settings.turn_rad if form.own_angles else float(angles[0]),
        tilt=tilt if form.tilt else settings.tilt,
        gains=gains if gained else settings.gains,
    )
