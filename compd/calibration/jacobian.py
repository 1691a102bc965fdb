"""How measured poses change with the numbers of the drawing: scaled columns, the registration projected out.

Columns are per tolerance and rows per standard deviation of the noise, so that a singular value s says: a tolerance of
this combination of numbers moves the measurements by s standard deviations. Below 1 the poses tell less of the
combination than the drawing does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray
from compd.calibration.parameters import Parameters
from compd.comparison import AlignedRecording
from compd.model import Deltas, MachineModel, Prediction, sensitivities, split_by_port
from compd.model.effects import Observations, Port, evaluate_basis
from compd.statistics import column_norms

# Singular value, of columns of length 1, below which a combination of registration numbers moves nothing.
_IDLE = 1e-9


def measured_columns(
    aligned: AlignedRecording, parameters: Parameters, as_read: Observations | None = None
) -> FloatArray:
    """(N, m, P) derivatives of a recording's measured coordinates, mm (a urad of an attitude as a um) per tolerance.

    as_read : rows from which the effects are computed, where those of the recording are moved; see `moved_to`.
    """
    columns = []
    for block in parameters.blocks:
        basis, _ = evaluate_basis(block.effect, aligned.rows if as_read is None else as_read, {}, None)
        columns.append(aligned.propagated(block.effect, basis)[:, :, block.used])
    return np.concatenate(columns, axis=2) * parameters.prior_std


def moved_to(aligned: AlignedRecording, prediction: Prediction, added: Deltas) -> AlignedRecording:
    """The recording on the machine with what effects add, at the poses that are predicted so: for derivatives there.

    Of a tool that stands on the plate, whose pose the prediction does not give, as drawn.
    """
    model, rows = aligned.model, aligned.rows
    if model is None or model.arrangement.on_plate or not added:
        return aligned
    base_mm = _moved(rows.base_joints_M_mm, added.get("base_joint"))
    # what actuators that slide or turn carry goes with their readings
    scale_mm = _moved(rows.scale_mm, added.get("scale"))
    base_mm = base_mm + _carried_mm(model, scale_mm) - _carried_mm(model, rows.scale_mm)
    joints_mm, axes, tool_mm = (
        _moved(points, None if port not in added else added[port][0])
        for points, port in (
            (model.platform_joints_P_mm, "platform_joint"),
            (model.revolute_axes_P, "revolute_axis"),
            (model.arrangement.tool_mm, "tool"),
        )
    )
    origin_mm = prediction.tip_mm - prediction.rotation_M_P @ tool_mm
    links_mm = origin_mm[:, None] + joints_mm @ prediction.rotation_M_P.transpose(0, 2, 1) - base_mm
    link_mm = np.linalg.norm(links_mm, axis=2)
    moved = replace(
        rows,
        constants=rows.constants._replace(platform_joints_P_mm=joints_mm, revolute_axes_P=axes),
        scale_mm=scale_mm,
        base_joints_M_mm=base_mm,
        origin_M_mm=origin_mm,
        rotation_M_P=prediction.rotation_M_P,
        tip_M_mm=prediction.tip_mm,
        link_mm=link_mm,
        directions_M=links_mm / link_mm[:, :, None],
    )
    built = replace(model, platform_joints_P_mm=joints_mm, revolute_axes_P=axes)
    return replace(aligned, model=built, rows=moved, _by_port={})


def _carried_mm(model: MachineModel, scale_mm: FloatArray) -> FloatArray:
    """(N, n, 3) base joints on the frame as at machine zero, with the scales at (N, m)."""
    mechanism, _ = model.links_on(model.frame.zero_rotation_M_B, model.base_joints_at_0_M_mm, scale_mm)
    return mechanism.base_joints_M_mm


def _moved(points: FloatArray, by: FloatArray | None) -> FloatArray:
    return points if by is None else points + by.reshape(points.shape)


def pose_columns(model: MachineModel, rows: Observations, parameters: Parameters) -> FloatArray:
    """(N, 6, P) derivatives of the tip, mm, and of the attitude, rad about {M}'s axes, per tolerance."""
    ports: list[Port] = sorted({port for block in parameters.blocks for port in block.effect.ports})
    by_port = {port: np.concatenate(one[:2], axis=1) for port, one in sensitivities(model, rows, ports).items()}
    columns = []
    for block in parameters.blocks:
        basis, _ = evaluate_basis(block.effect, rows, {}, None)
        added = split_by_port(block.effect, rows, basis)
        moved = [by_port[port] @ values for port, values in added.items()]
        columns.append(np.asarray(sum(moved[1:], start=moved[0]))[:, :, block.used])
    return np.concatenate(columns, axis=2) * parameters.prior_std


def rigid_columns(tip_M_mm: FloatArray, about_M_mm: FloatArray) -> FloatArray:
    """(N, 3, 6) the tip by a displacement, mm, and by a rotation about axes of {M} through a place (3,), rad."""
    lever = tip_M_mm - about_M_mm
    turned = np.stack([np.cross(axis, lever) for axis in np.eye(3)], axis=2)
    return np.concatenate([np.broadcast_to(np.eye(3), (len(lever), 3, 3)), turned], axis=2)


def scaled_jacobian(
    columns: Sequence[FloatArray], registrations: Sequence[FloatArray], sigmas: Sequence[FloatArray]
) -> FloatArray:
    """(sum of N m, P) of several recordings, each with its registration projected out.

    columns : (N, m, P) each, per tolerance.  registrations : (N, m, Q) each, Q may be 0.  sigmas : (m,) each, in the
    unit of the columns.
    """
    parts = []
    for J, R, sigma in zip(columns, registrations, sigmas, strict=True):
        A = (J / sigma[:, None]).reshape(-1, J.shape[2])
        parts.append(without(A, (R / sigma[:, None]).reshape(len(A), -1)))
    return np.concatenate(parts)


def without(A: FloatArray, R: FloatArray) -> FloatArray:
    """A (n, P) less what the columns of R (n, Q) can make of it."""
    if not R.size:
        return A
    U, sizes, _ = np.linalg.svd(R / column_norms(R), full_matrices=False)
    U = U[:, sizes > _IDLE * sizes[0]]
    return np.asarray(A - U @ (U.T @ A))
