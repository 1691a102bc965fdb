"""The forward model with something added at its ports: what a reference instrument would show of the tip."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.model.deltas import Deltas
from compd.model.effects import Observations, Port
from compd.model.kernels import joint_shortening
from compd.model.kinematics import Mechanism, forward_kinematics, link_length_mm, solve_frame
from compd.model.machine import MachineModel
from compd.rotation import compose, rotation_matrix


class Prediction(NamedTuple):
    """What a perfect reference, or with deltas at the port `reference` a real one, shows.

    tip_mm : (N, 3), the tip in {M}; with the tool on the plate the place on the work that it touches, in {P}.
    rotation_M_P : (N, 3, 3).  link_length_mm : (N, n).
    reason : (N,), a Reason; where it is not OK everything else is nan.
    """

    tip_mm: FloatArray
    rotation_M_P: FloatArray
    link_length_mm: FloatArray
    reason: IntArray


class PerturbedMachine(NamedTuple):
    """The machine with something added at its ports, before any link length is known.

    mechanism : with the base joints as they are now, by equation (3).
    tool_mm : (..., 3), in {P}; of a tool that stands on the plate, in {M}.
    joint_shortening_mm : (..., n), gB + gS of equation (1).
    reading_to_length_mm : (..., n), what the ports `scale` and `link` add between a scale's reading and its link.
    reason : (...), a Reason, of the frame and the joint comparators.
    """

    mechanism: Mechanism
    tool_mm: FloatArray
    joint_shortening_mm: FloatArray
    reading_to_length_mm: FloatArray | float
    reason: IntArray


def perturb_machine(
    model: MachineModel,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    deltas: Deltas,
    base_joints_M_mm: FloatArray | None = None,
) -> PerturbedMachine:
    """The machine with gauges and `deltas` accounted for; forward and inverse kinematics both start from it.

    joint_mm (..., k), frame_mm (..., 9): changes since machine zero.  deltas : (..., size) per port, in mm (rad for
    directions); a port left out gets nothing.  base_joints_M_mm : (..., n, 3) without deltas, where the frame is solved
    already.
    """
    frame_reason: IntArray = np.zeros((), dtype=np.int64)
    # a row without a frame is solved again: only that gives the reason
    if base_joints_M_mm is None or {"frame", "plate"} & set(deltas) or not np.isfinite(base_joints_M_mm).all():
        geometry = model.frame._replace(
            plate_points_M_mm=_add_to_points(model.frame.plate_points_M_mm, "plate", deltas)
        )
        since_zero_mm = _add(frame_mm, "frame", deltas)
        if "plate" not in deltas and since_zero_mm.ndim == 2 and (since_zero_mm == since_zero_mm[:1]).all():
            since_zero_mm = since_zero_mm[:1]  # a frame that does not move is solved once
        frame = solve_frame(geometry, model.zero.distances_mm + since_zero_mm)
        base_joints_M_mm, frame_reason = frame.base_joints_M_mm, frame.reason
    shortening_mm, reason = joint_shortening(model.joint_weights, _add(joint_mm, "joint", deltas))
    mechanism = Mechanism(
        _add_to_points(base_joints_M_mm, "base_joint", deltas),
        _add_to_points(model.platform_joints_P_mm, "platform_joint", deltas),
        _add_to_points(model.revolute_axes_P, "revolute_axis", deltas),
        model.hinges,
    )
    tool_mm = _add(model.arrangement.tool_mm, "tool", deltas)
    to_length_mm = deltas.get("scale", 0.0) + deltas.get("link", 0.0)
    return PerturbedMachine(mechanism, tool_mm, shortening_mm, to_length_mm, np.maximum(reason, frame_reason))


def predict(model: MachineModel, rows: Observations, deltas: Deltas) -> Prediction:
    """Equations (1), (3) and forward kinematics with `deltas` added at the machine's ports.

    deltas : as in `perturb_machine`; and at the port `reference`, which is no part of the machine.
    A row fails as `solve_frame` and `forward_kinematics` do.

    Example: what 1 um more on every scale does to the tip, row by row:

        nominal = predict(model, rows, {})
        longer = predict(model, rows, {"scale": np.full((len(rows), model.links), 1e-3)})
        change_um = (longer.tip_mm - nominal.tip_mm) * 1e3
    """
    machine = perturb_machine(model, rows.joint_mm, rows.frame_mm, deltas, rows.base_joints_M_mm)
    length_mm = link_length_mm(model.zero.link_length_mm, rows.scale_mm, machine.joint_shortening_mm)
    pose = forward_kinematics(
        machine.mechanism, length_mm + machine.reading_to_length_mm, rows.origin_M_mm, rows.rotation_M_P
    )
    tip_mm = model.arrangement.measured_tip_mm(model.arrangement.contact_at(pose, machine.tool_mm))
    rotation = pose.rotation_M_P
    if "reference" in deltas:
        tip_mm = tip_mm + deltas["reference"][:, :3]
        rotation = compose(rotation_matrix(deltas["reference"][:, 3:]), rotation)
    return Prediction(tip_mm, rotation, pose.link_length_mm, np.maximum(machine.reason, pose.reason))


def _add(value: FloatArray, port: Port, deltas: Deltas) -> FloatArray:
    return value + deltas[port] if port in deltas else value


def _add_to_points(points: FloatArray, port: Port, deltas: Deltas) -> FloatArray:
    """Points (..., m, 3) with their deltas (..., 3 m)."""
    return points + deltas[port].reshape(*deltas[port].shape[:-1], -1, 3) if port in deltas else points
