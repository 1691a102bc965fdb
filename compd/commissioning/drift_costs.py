"""What a drift of one length costs at the tip: from the kinematics, at machine zero."""

from __future__ import annotations

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.commissioning.jump_trials import measured_lengths
from compd.compensation import Compensation, GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.configuration import Configuration
from compd.errors import KinematicsError
from compd.machine_builder import build_model
from compd.model import MachineModel
from compd.model.kinematics import ToolOnPlate
from compd.operation_settings import measured_distances
from compd.units import UM_PER_MM

DRIFT_UM = 10.0


class DriftCost(NamedTuple):
    """Tip error (um) at machine zero of a drift of one length by DRIFT_UM.

    length : as "scale 1". cmm_um : error of the published tip. machine_tool_um : by how much the tip misses its target.
    """

    length: str
    gauge: str
    cmm_um: float
    machine_tool_um: float


def drift_costs(configuration: Configuration) -> list[DriftCost]:
    """Tip error for every length gauge, scales first, then joints and frame: from the kinematics, at machine zero."""
    model = build_model(configuration.geometry, configuration.wiring)
    gauge_of = {length: gauge for gauge, lengths in measured_lengths(configuration).items() for length in lengths}
    lengths = [f"scale {link}" for link in range(1, model.scales + 1)]
    lengths += [f"joint {k}" for k in range(1, len(configuration.wiring.joint) + 1)]
    lengths += [f"frame {distance}" for distance in measured_distances(len(configuration.wiring.frame))]
    drift_mm = DRIFT_UM / UM_PER_MM
    costs = []
    for number, length in enumerate(lengths):
        change_mm = np.zeros(len(lengths))
        change_mm[number] = drift_mm
        costs.append(DriftCost(length, gauge_of[length], *_tip_errors_um(model, change_mm)))
    return costs


def exchange_mm(configuration: Configuration) -> float:
    """Largest error at the tip for two exchanged scales 1 mm apart."""
    model = build_model(configuration.geometry, configuration.wiring)
    drift_mm = DRIFT_UM / UM_PER_MM
    errors_um = []
    for one, other in combinations(range(model.scales), 2):
        change_mm = np.zeros(model.scales + len(configuration.wiring.joint) + len(configuration.wiring.frame))
        change_mm[one], change_mm[other] = drift_mm, -drift_mm
        errors_um.append(_tip_errors_um(model, change_mm)[0])
    return max(errors_um) / DRIFT_UM


def _tip_errors_um(model: MachineModel, change_mm: FloatArray) -> tuple[float, float]:
    """Error at the tip of readings with an error of `change_mm`, in CMM and in machine-tool mode."""
    start = WarmStart.at_zero(model)
    shown, _ = compensate_cmm(model, _values(model, change_mm), start)
    cmm_um = _away_um(model, shown)
    # in machine-tool mode the drive follows the scale setpoint by the wrong scale
    try:
        command, _ = compensate_machine_tool(model, target_at_zero(model), None, _values(model, change_mm), start)
    except KinematicsError:
        return cmm_um, math.nan
    true_scale_mm = command.scale_setpoint_mm - change_mm[: model.scales]
    reached, _ = compensate_cmm(
        model, _values(model, np.concatenate([true_scale_mm, 0 * change_mm[model.scales :]])), start
    )
    return cmm_um, _away_um(model, reached)


def _away_um(model: MachineModel, computed: Compensation) -> float:
    """Distance of the tip from that at machine zero; on the work with the tool on the plate."""
    contact = model.zero.contact
    if isinstance(model.arrangement, ToolOnPlate):
        return float(np.linalg.norm(computed.tip_P_mm - contact.tip_P_mm) * UM_PER_MM)
    return float(np.linalg.norm(computed.tip_M_mm - contact.tip_M_mm) * UM_PER_MM)


def target_at_zero(model: MachineModel) -> FloatArray:
    """(3,) the target of machine zero: in {B0}, with the tool on the plate in {P}."""
    contact, frame = model.zero.contact, model.frame
    if isinstance(model.arrangement, ToolOnPlate):
        return contact.tip_P_mm
    return np.asarray(frame.zero_rotation_M_B.T @ (contact.tip_M_mm - frame.zero_origin_M_mm))


def _values(model: MachineModel, change_mm: FloatArray) -> GaugeValues:
    n, k = model.scales, model.joint_weights.shape[1]
    return GaugeValues(change_mm[:n], change_mm[n : n + k], change_mm[n + k :], {})
