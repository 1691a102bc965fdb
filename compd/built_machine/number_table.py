"""The numbers of a machine as CSV: joints, zeros, directions, and the numbers of its effects, such as gains."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from compd.configuration import Configuration, Geometry, SlidingActuator, TurningActuator
from compd.machine_builder import build_model
from compd.model import MachineModel
from compd.model.effects import FittedEffect
from compd.model_file import parameter_estimates


class MachineNumber(NamedTuple):
    """One number of a machine, a row of the table.

    part : "base joint", "platform joint", "rod", "hinge", "actuator", "tool", "machine zero", or an effect's id.
    number : of the part, from 1; None for a part of which there is one.  name : "x", "length", "radius" or the name of
    an effect's number.  frame : "B", "P", "M" or empty.  value, standard_error : in unit; the second nan where it is
    not known, and for what the configuration states.
    """

    part: str
    number: int | None
    name: str
    frame: str
    value: float
    standard_error: float
    unit: str


def numbers_text(configuration: Configuration, effects: Sequence[FittedEffect] = ()) -> str:
    """The table as CSV, with the names of `MachineNumber` as its header; of a number that is not known, nothing."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(MachineNumber._fields)
    for row in machine_numbers(configuration, effects):
        error = "" if math.isnan(row.standard_error) else repr(row.standard_error)
        number = "" if row.number is None else row.number
        writer.writerow([row.part, number, row.name, row.frame, repr(row.value), error, row.unit])
    return out.getvalue()


def machine_numbers(configuration: Configuration, effects: Sequence[FittedEffect] = ()) -> list[MachineNumber]:
    """The numbers of a machine's geometry, link by link, and of its effects.

    Lengths of rods and places of actuators are those at machine zero, where all gauges read 0.
    Raises KinematicsError where the configuration's machine zero cannot be reached.
    """
    geometry = configuration.geometry
    model = build_model(geometry, configuration.wiring)
    rows = [*_joints(geometry, model), *_actuators(geometry, model), *_zero(geometry, model)]
    for effect, one in parameter_estimates(effects, geometry.links):
        rows.append(MachineNumber(effect, None, one["name"], "", one["value"], one["std"], one["unit"]))
    return rows


def _joints(geometry: Geometry, model: MachineModel) -> Iterator[MachineNumber]:
    for i, rod in enumerate(geometry.mechanism.rods, start=1):
        yield from _vector("base joint", i, rod.base_B_mm, "B", "mm")
        yield from _vector("platform joint", i, rod.platform_P_mm, "P", "mm")
        yield _stated("rod", i, "length", "", float(model.zero.link_length_mm[i - 1]), "mm")
    for i, hinge in enumerate(geometry.mechanism.hinges, start=1):
        axis, frame = (hinge.axis_P, "P") if hinge.axis_B is None else (hinge.axis_B, "B")
        assert axis is not None, "one of the two"
        yield from _vector("hinge", i, axis, frame, "1")


def _actuators(geometry: Geometry, model: MachineModel) -> Iterator[MachineNumber]:
    for i, actuator in enumerate(geometry.mechanism.actuators, start=1):
        if isinstance(actuator, SlidingActuator):
            yield from _vector("actuator", i, actuator.along_B, "B", "1", "along ")
        elif isinstance(actuator, TurningActuator):
            yield _stated("actuator", i, "radius", "", actuator.radius_mm, "mm")
            yield from _vector("actuator", i, actuator.cosine_B, "B", "1", "cosine ")
            yield from _vector("actuator", i, actuator.sine_B, "B", "1", "sine ")
        else:
            continue
        yield _stated("actuator", i, "zero", "", float(model.zero.actuator_mm[i - 1]), "mm")


def _zero(geometry: Geometry, model: MachineModel) -> Iterator[MachineNumber]:
    tool, contact = geometry.keys.tool, geometry.keys.zero_contact
    frames = ("P", "M") if geometry.keys.tool_on_platform else ("M", "P")
    yield from _vector("tool", None, getattr(geometry.tool, str(tool[-1])), frames[0], "mm")
    yield from _vector("machine zero", None, getattr(geometry.tool, str(contact[-1])), frames[1], "mm")
    for k, name in enumerate(("rx", "ry", "rz")):
        value = geometry.tool.zero_rotation_P_in_M_rad[k]
        yield _stated("machine zero", None, name, "M", value, "rad")


def _vector(
    part: str, number: int | None, vector: tuple[float, float, float], frame: str, unit: str, name: str = ""
) -> Iterator[MachineNumber]:
    for axis, value in zip("xyz", vector, strict=True):
        yield _stated(part, number, f"{name}{axis}", frame, float(value), unit)


def _stated(part: str, number: int | None, name: str, frame: str, value: float, unit: str) -> MachineNumber:
    return MachineNumber(part, number, name, frame, value, math.nan, unit)
