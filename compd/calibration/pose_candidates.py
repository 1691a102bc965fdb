"""Poses that a machine can take, away from its singularities: what a calibration could measure next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats.qmc import Sobol

from compd.arrays import FloatArray, IntArray
from compd.errors import CompdError
from compd.machine_reach import amplification, amplifications, machine_reach, within_stroke
from compd.model import MachineModel, observe
from compd.model.effects import Observations
from compd.model.kinematics import Mechanism, Movement, Pose, inverse_kinematics, links_at
from compd.rotation import compose, rotation_matrix, to_outer

# Of the way to a singularity or to the end of the reach along one coordinate, so much is used: several coordinates are
# away from machine zero at once.
_SHARE = 0.6
# A turn beyond this is rare in use, and joints of most machines end before.
_MOST_TURN_RAD = np.deg2rad(15.0)
# Of a link's length: actuators of most machines move it by no more either way.
_STROKE_SHARE = 0.25
# A pose counts as near a singularity where an error of length makes so many times the error that it makes at machine
# zero: the poses are to be measured, and held, as well as others.
_MOST_AMPLIFIED = 2.0
# Share of an actuator's motion that has to go along its rod: a rod within 12 degrees of square to its rail, or in line
# with its crank, makes its actuator's error the pose's five times.
_LEAST_TRANSMISSION = 0.2
# Kinematics there and back differs by rounding alone, 1e-9 mm.
_SAME_MM = 1e-6
# For the derivative of a joint's place by its actuator.
_STEP_MM = 0.01
# Steps of a way from machine zero to a pose.
_STEPS = 10


class Box(NamedTuple):
    """Limits of poses: low, high (6,), of the tip x, y, z in {M}, mm, and of turns about x, y, z of {M}, rad, since
    machine zero. Coordinates that a target does not fix follow: theirs are not read."""

    low: FloatArray
    high: FloatArray


class PoseCandidates(NamedTuple):
    """N poses that can be reached. rows : with perfect gauges.  turn_rad : (N, 3) rotation vectors in {M} since machine
    zero, 0 where a target fixes none.  asked : (N,) their places among the poses that were asked for."""

    rows: Observations
    turn_rad: FloatArray
    asked: IntArray

    @property
    def tip_M_mm(self) -> FloatArray:
        """(N, 3)."""
        return self.rows.tip_M_mm

    def select(self, index: IntArray) -> PoseCandidates:
        """Some of them."""
        return PoseCandidates(self.rows.select(index), self.turn_rad[index], self.asked[index])


def reachable_box(model: MachineModel, stroke_mm: tuple[float, float] | None = None) -> Box:
    """A share of what the machine reaches along each coordinate alone, about machine zero.

    stroke_mm : shortest and longest length of an extending link, or None.
    """
    low, high = np.zeros(6), np.zeros(6)
    for way in machine_reach(model, stroke_mm).ways:
        place = "xyzabc".index(way.coordinate)
        most = _MOST_TURN_RAD if place >= 3 else _stroke_mm(model)
        far = min(_SHARE * way.reach, most)
        (low if way.sign < 0 else high)[place] = way.sign * far
    low[:3] += model.zero.contact.tip_M_mm
    high[:3] += model.zero.contact.tip_M_mm
    return Box(low, high)


def even_poses(model: MachineModel, box: Box, count: int, seed: int = 0) -> FloatArray:
    """(count, 6) poses that fill a box evenly: I. M. Sobol, USSR Comp. Math. 7 (1967) 86, scrambled by `seed`."""
    fixed = model.actuators.fixed == 1
    # drawn in a power of two, in which the sequence is balanced
    power = int(np.ceil(np.log2(count)))
    shares = Sobol(int(fixed.sum()), rng=seed).random_base2(power)[:count]
    poses = np.tile(_at_zero(model), (count, 1))
    poses[:, fixed] = box.low[fixed] + shares * (box.high - box.low)[fixed]
    return poses


def candidate_poses(model: MachineModel, box: Box, count: int) -> FloatArray:
    """(M, 6) poses of which the most telling are chosen: `count` within a box, and half as many on its faces and edges.

    Those of the second kind have each coordinate at its lowest, middle or highest.
    """
    inside = even_poses(model, box, count)
    middle, half = (box.low + box.high) / 2, (box.high - box.low) / 2
    shares = (even_poses(model, box, count // 2, seed=1) - middle) / np.where(half > 0, half, 1.0)
    outside = middle + half * np.clip(np.round(1.5 * shares), -1, 1)
    free = model.actuators.fixed == 0
    outside[:, free] = _at_zero(model)[free]
    return np.concatenate([inside, np.unique(outside, axis=0)])


def reachable(model: MachineModel, poses: FloatArray, stroke_mm: tuple[float, float] | None = None) -> PoseCandidates:
    """Those of the poses (N, 6) that the machine as drawn reaches, with its links within their stroke and away from
    singularities. Coordinates that a target does not fix follow.

    Raises CompdError where a tool on the plate has no place of its own to plan, or no pose is reached.
    """
    if model.arrangement.on_plate:
        raise CompdError.of(
            "plan",
            "plans places of a tool on the platform",
            value="tool on: plate",
            next_step="choose places on the work by hand",
        )
    zero, fixed = model.zero, model.actuators.fixed == 1
    mechanism = Mechanism(model.base_joints_at_0_M_mm, model.platform_joints_P_mm, model.revolute_axes_P, model.hinges)
    at_zero = model.mechanism(zero.base_joints_M_mm)
    most = _MOST_AMPLIFIED * amplification(at_zero, zero.platform_origin_M_mm, zero.rotation_M_P)
    turns = np.where(fixed[3:], poses[:, 3:], 0.0)
    actuator_mm = np.broadcast_to(zero.actuator_mm, (len(poses), model.scales))
    good = np.ones(len(poses), dtype=bool)
    at_rest = inverse_kinematics(mechanism, model.actuators, *zero.contact, zero.rotation_M_P, zero.actuator_mm)
    sides = np.sign(_transmission(model, at_rest.pose, at_rest.actuator_mm, at_rest.base_joints_M_mm))
    # followed from machine zero, so that no way crosses a singularity into another assembly
    for share in np.arange(1, _STEPS + 1) / _STEPS:
        found = inverse_kinematics(
            mechanism,
            model.actuators,
            zero.contact.tip_M_mm + share * (poses[:, :3] - zero.contact.tip_M_mm),
            zero.contact.tip_P_mm,
            compose(rotation_matrix(share * turns), zero.rotation_M_P),
            actuator_mm,
        )
        here, pose = mechanism._replace(base_joints_M_mm=found.base_joints_M_mm), found.pose
        good &= (pose.reason == 0) & (amplifications(here, pose.origin_M_mm, pose.rotation_M_P) <= most)
        good &= (
            sides * _transmission(model, pose, found.actuator_mm, found.base_joints_M_mm) >= _LEAST_TRANSMISSION
        ).all(axis=1)
        actuator_mm = np.where(good[:, None], found.actuator_mm, zero.actuator_mm)
    good &= (np.abs(actuator_mm - zero.actuator_mm) <= _stroke_mm(model)).all(axis=1)
    good &= within_stroke(model, pose.link_length_mm, stroke_mm)
    rows = rows_at(model, actuator_mm[good] - zero.actuator_mm)
    # a recording's poses are solved from machine zero: one that leads to another assembly from there is of no use
    off_mm = np.abs(rows.origin_M_mm - pose.origin_M_mm[good]).max(axis=1)
    solved = np.flatnonzero(off_mm < _SAME_MM)
    if not len(solved):
        raise CompdError.of("plan", "no pose within these limits can be reached", next_step="widen --workspace")
    return PoseCandidates(rows, turns[good], np.flatnonzero(good)).select(solved)


def _stroke_mm(model: MachineModel) -> float:
    return _STROKE_SHARE * float(model.zero.link_length_mm.mean())


def _transmission(model: MachineModel, pose: Pose, actuator_mm: FloatArray, base_joints_M_mm: FloatArray) -> FloatArray:
    """(..., n) how much of an actuator's motion goes along its rod; 1 where it makes the rod longer.

    At 0 the actuator stands still however the platform moves, and a pose has two places of the actuator beyond.
    """
    ends_M_mm = to_outer(pose.rotation_M_P[..., None, :, :], pose.origin_M_mm[..., None, :], model.platform_joints_P_mm)
    rods = (ends_M_mm - base_joints_M_mm) / pose.link_length_mm[..., None]
    ahead, behind = (
        links_at(model.actuators, model.base_joints_at_0_M_mm, actuator_mm + step)[0] for step in (_STEP_MM, -_STEP_MM)
    )
    along = ((ahead - behind) / (2 * _STEP_MM) * rods).sum(axis=-1)
    return np.where(model.extended, 1.0, along)


def _at_zero(model: MachineModel) -> FloatArray:
    return np.concatenate([model.zero.contact.tip_M_mm, np.zeros(3)])


def rows_at(model: MachineModel, scale_mm: FloatArray) -> Observations:
    """Rows with the scales (N, m) at these readings, all other gauges at zero."""
    count = len(scale_mm)
    joint_mm = np.zeros((count, model.joint_weights.shape[1]))
    assert model.constants is not None
    return observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=np.zeros((count, 9)),
        quantities={},
        time_s=np.arange(float(count)),
        session_start=np.ones(count, dtype=bool),
        movement=Movement.unknown(scale_mm, joint_mm),
    )
