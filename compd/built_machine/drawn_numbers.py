"""From a machine with fitted effects to the numbers of its drawing that state the same.

Some effects only correct numbers of a drawing: a joint sits elsewhere, a rod has another length, machine zero is at
another pose. What these add is the same in all rows, so that one row tells it. All others, such as the gain of a scale,
have no number in a drawing and stay effects.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration
from compd.documents import Location, Value
from compd.errors import CompdError
from compd.machine_builder import build_model
from compd.model import Deltas, MachineModel, effect_deltas, observe, predict, sum_deltas
from compd.model.effects import FittedEffect, Observations, Port, needed_quantities
from compd.model.kernels import require
from compd.model.kinematics import Movement
from compd.rotation import rotation_vector, to_inner

# What a drawing states: where joints, hinges and the tool are, how long rods are, and where machine zero is.
_OF_A_DRAWING: frozenset[Port] = frozenset({"scale", "link", "base_joint", "platform_joint", "revolute_axis", "tool"})
# What an effect of a drawing's numbers may need, all of it given by the kinematics at rest.
_AT_REST = frozenset({"kinematics", "scale", "revolute_axes"})
# Digits of a written number: 1 nm, and 1 nrad, which is 1 nm at 1 m.
_DECIMALS_MM, _DECIMALS_RAD = 6, 9


class BuiltGeometry(NamedTuple):
    """The numbers of the machine as built.

    numbers : those that differ from the drawing's, by their place in the configuration's file; mm, rotation vectors in
        rad, unit vectors; rounded to 1e-6 mm and 1e-9.
    stated : indices of the effects whose numbers these are.  others : of those that no number of a drawing states.
    """

    numbers: Mapping[Location, Value]
    stated: tuple[int, ...]
    others: tuple[int, ...]


def built_geometry(configuration: Configuration, fitted: Sequence[FittedEffect]) -> BuiltGeometry:
    """The numbers of a configuration with which its machine does what these effects add to it.

    Raises CompdError for `machine: external`, KinematicsError where the machine as built has no machine zero.
    """
    if configuration.external is not None:
        raise CompdError.of(
            configuration.where("machine"),
            "compd knows no joints of this machine",
            value=configuration.machine,
            next_step="write the effects into a model file: `compd model add`",
        )
    model = build_model(configuration.geometry, configuration.wiring)
    rows = _two_rows(model)
    deltas: list[Deltas] = []
    stated: list[int] = []
    for index, effect in enumerate(fitted):
        if (constant := _constant_deltas(effect, rows)) is not None:
            stated.append(index)
            deltas.append(constant)
    changed = dict(_numbers(configuration, model, rows, sum_deltas(deltas))) if stated else {}
    others = tuple(index for index in range(len(fitted)) if index not in stated)
    return BuiltGeometry(changed, tuple(stated), others)


def _two_rows(model: MachineModel) -> Observations:
    """Machine zero, and a place with all scales 1 mm on; what differs there is no number of a drawing."""
    assert model.constants is not None
    scale_mm, joint_mm = np.outer([0.0, 1.0], np.ones(model.scales)), np.zeros((2, model.joint_weights.shape[1]))
    return observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=np.zeros((2, 9)),
        quantities={},
        time_s=np.arange(2.0),
        session_start=np.array([True, False]),
        movement=Movement.unknown(scale_mm, joint_mm),
    )


def _constant_deltas(fitted: FittedEffect, rows: Observations) -> Deltas | None:
    """What an effect adds in all rows alike, by port (N, size); None for an effect that follows something."""
    effect = fitted.effect
    if not (set(effect.ports) <= _OF_A_DRAWING and set(effect.needs) <= _AT_REST):
        return None
    if needed_quantities(effect, rows.links):
        return None
    deltas, _ = effect_deltas(fitted, rows)
    return deltas if all(np.array_equal(value[0], value[1]) for value in deltas.values()) else None


def _numbers(
    configuration: Configuration, model: MachineModel, rows: Observations, deltas: Deltas
) -> Iterator[tuple[Location, Value]]:
    """Each number that the deltas (N, size) change, at its place. rows : the first is machine zero."""
    geometry, keys, rods = configuration.geometry, configuration.geometry.keys, configuration.geometry.mechanism.rods
    rotation_M_B, nowhere = model.frame.zero_rotation_M_B, np.zeros(3)
    for link, moved_M_mm in enumerate(_vectors(deltas, "base_joint")):
        yield keys.base_joint(link), _place(rods[link].base_B_mm + to_inner(rotation_M_B, nowhere, moved_M_mm))
    for link, moved_P_mm in enumerate(_vectors(deltas, "platform_joint")):
        yield keys.platform_joint(link), _place(np.array(rods[link].platform_P_mm) + moved_P_mm)
    for hinge, turned in enumerate(_vectors(deltas, "revolute_axis")):
        axis = model.revolute_axes_P[hinge] + turned
        if model.hinges[hinge, 1]:
            axis = to_inner(rotation_M_B, nowhere, axis)
        yield keys.hinge_axis(hinge), _rounded(axis / np.linalg.norm(axis), _DECIMALS_RAD)
    if "link" in deltas:
        for link in np.flatnonzero(~model.extended).tolist():
            yield keys.rod_length(link), round(rods[link].length_mm + float(deltas["link"][0, link]), _DECIMALS_MM)
    if "tool" in deltas:
        yield keys.tool, _place(model.arrangement.tool_mm + deltas["tool"][0])
    # where the machine stands with all gauges at zero
    at_zero = predict(model, rows, deltas)
    require(at_zero.reason, "the machine as built at machine zero", "check the effects: their numbers are too large")
    yield keys.zero_contact, _place(at_zero.tip_mm[0])
    if geometry.kinematics != "tripod_3spr":
        yield keys.zero_attitude, _rounded(rotation_vector(at_zero.rotation_M_P[0]), _DECIMALS_RAD)


def _vectors(deltas: Deltas, port: Port) -> FloatArray:
    """(k, 3) of the first row; (0, 3) where nothing is added there."""
    return deltas[port][0].reshape(-1, 3) if port in deltas else np.zeros((0, 3))


def _place(place_mm: FloatArray) -> tuple[float, ...]:
    return _rounded(place_mm, _DECIMALS_MM)


def _rounded(vector: FloatArray, decimals: int) -> tuple[float, ...]:
    return tuple(round(float(value), decimals) + 0.0 for value in vector)
