"""The forward model with something added at its ports: what a reference instrument would show of the tip."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.model.deltas import Deltas
from compd.model.effects import Observations, Port
from compd.model.kernels import joint_shortening
from compd.model.kinematics import Mechanism, forward_kinematics, solve_frame
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
    """The machine with something added at its ports, and with the joints' errors taken from its links.

    mechanism : with the base joints as they are now, by equation (3), and where the scales have moved them.
    tool_mm : (..., 3), in {P}; of a tool that stands on the plate, in {M}.
    length_mm : (..., n), by equation (1), with what the ports `scale` and `link` add.
    reason : (...), a Reason, of the frame and the joint comparators.
    """

    mechanism: Mechanism
    tool_mm: FloatArray
    length_mm: FloatArray
    reason: IntArray


def perturb_machine(
    model: MachineModel,
    scale_mm: FloatArray,
    joint_mm: FloatArray,
    frame_mm: FloatArray,
    deltas: Deltas,
    base_joints_M_mm: FloatArray | None = None,
) -> PerturbedMachine:
    """The machine with gauges and `deltas` accounted for.

    scale_mm (..., m), joint_mm (..., k), frame_mm (..., 9): changes since machine zero.  deltas : (..., size) per port,
    in mm (rad for directions); a port left out gets nothing.  base_joints_M_mm : (..., n, 3) without deltas, where the
    frame is solved already.
    """
    frame_reason: IntArray = np.zeros((), dtype=np.int64)
    reading_mm = _add(scale_mm, "scale", deltas) if model.base_turns_parts else scale_mm
    # a row without a frame is solved again: only that gives the reason
    solved = base_joints_M_mm is not None and bool(np.isfinite(base_joints_M_mm).all())
    if solved and not ({"frame", "plate"} & set(deltas) or model.base_turns_parts):
        assert base_joints_M_mm is not None
        mechanism = model.mechanism(base_joints_M_mm)
        length_mm = model.lengths_mm(reading_mm)
    else:
        geometry = model.frame._replace(
            plate_points_M_mm=_add_to_points(model.frame.plate_points_M_mm, "plate", deltas)
        )
        since_zero_mm = _add(frame_mm, "frame", deltas)
        if "plate" not in deltas and since_zero_mm.ndim == 2 and (since_zero_mm == since_zero_mm[:1]).all():
            since_zero_mm = since_zero_mm[:1]  # a frame that does not move is solved once
        frame = solve_frame(geometry, model.zero.distances_mm + since_zero_mm)
        mechanism, length_mm = model.links_on(frame.rotation_M_B, frame.base_joints_M_mm, reading_mm)
        frame_reason = frame.reason
    shortening_mm, reason = joint_shortening(model.joint_weights, _add(joint_mm, "joint", deltas))
    to_length_mm: FloatArray | float = deltas.get("link", 0.0)
    if "scale" in deltas and not model.base_turns_parts:
        to_length_mm = deltas["scale"][..., model.actuators.of_link] + to_length_mm
    mechanism = Mechanism(
        _add_to_points(mechanism.base_joints_M_mm, "base_joint", deltas),
        _add_to_points(model.platform_joints_P_mm, "platform_joint", deltas),
        _add_to_points(mechanism.revolute_axes, "revolute_axis", deltas),
        model.hinges,
    )
    return PerturbedMachine(
        mechanism,
        _add(model.arrangement.tool_mm, "tool", deltas),
        length_mm - shortening_mm + to_length_mm,
        np.maximum(reason, frame_reason),
    )


def predict(model: MachineModel, rows: Observations, deltas: Deltas) -> Prediction:
    """Equations (1), (3) and forward kinematics with `deltas` added at the machine's ports.

    deltas : as in `perturb_machine`; and at the port `reference`, which is no part of the machine.
    A row fails as `solve_frame` and `forward_kinematics` do.

    Example: what 1 um more on every scale does to the tip, row by row:

        nominal = predict(model, rows, {})
        longer = predict(model, rows, {"scale": np.full((len(rows), model.scales), 1e-3)})
        change_um = (longer.tip_mm - nominal.tip_mm) * 1e3
    """
    machine = perturb_machine(model, rows.scale_mm, rows.joint_mm, rows.frame_mm, deltas, rows.base_joints_M_mm)
    pose = forward_kinematics(machine.mechanism, machine.length_mm, rows.origin_M_mm, rows.rotation_M_P)
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
