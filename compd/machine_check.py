"""A configuration as a whole machine: every problem of the file and of the machine that it describes, at once.

`compd check`, `compd run` and a reload of the daemon read the configuration by this, so that all say the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from compd.configuration import (
    SECTIONS,
    Configuration,
    Examined,
    Geometry,
    effect_file_problems,
    examine,
    in_order,
    place_problems,
    place_warnings,
)
from compd.documents import Document, Location, Section, readable
from compd.errors import ConfigurationError, KinematicsError, PluginError, Problem
from compd.machine_builder import build_model, machine_parts
from compd.machine_reach import dependences_as_drawn
from compd.machine_slips import axes_along_links, slips
from compd.model import MachineModel
from compd.model.external import ExternalModel, OwnKinematicsError, own_pose
from compd.operation_settings import SocketSettings, StateSettings, Wiring

SectionT = TypeVar("SectionT", bound=Section)

# Of the words in which a warning asks for the unit, `compd.configuration.plausible`.
_IN_METRES = "in metres?"


def load_whole(path: Path) -> Configuration:
    """Read and check a configuration, with the machine that it describes; its warnings are complete.

    Raises ConfigurationError with every problem.
    """
    examined = examine_whole(path)
    if examined.configuration is None:
        raise ConfigurationError(examined.problems)
    return examined.configuration


def examine_whole(path: Path) -> Examined:
    """What `examine` finds in the file, with what the machine at machine zero and the places on the disk show.

    Raises ConfigurationError where the file as a whole cannot be read.
    """
    examined = examine(path)
    document, warnings = examined.document, list(examined.warnings)
    problems = list(examined.problems)
    if examined.geometry is not None and examined.wiring is not None and not _has_problem(problems):
        with np.errstate(all="ignore"):
            try:
                model = build_model(examined.geometry, examined.wiring)
            except PluginError as error:
                problems += [replace(p, where=document.where(tuple(p.where.split(".")))) for p in error.problems]
            except (KinematicsError, ValueError) as error:
                along = list(axes_along_links(document, examined.geometry))
                problems += _at_machine_zero(error, document, warnings, along)
                problems += _dependences(document, examined.geometry, examined.wiring)
            else:
                if isinstance(model, ExternalModel):
                    problems += _faults_at_zero(document, model)
                else:
                    warnings += [
                        *_stroke_warnings(document, examined.geometry, model),
                        *slips(document, examined.geometry, model),
                    ]
    sockets, state = _section(SocketSettings, document, "sockets"), _section(StateSettings, document, "state")
    effects = readable(SECTIONS["effects"], document.value(("effects",))) or ()
    problems = in_order(
        [*problems, *place_problems(document, sockets, state), *effect_file_problems(document, effects)]
    )
    warnings = in_order([*warnings, *place_warnings(document, sockets, state)])
    configuration = examined.configuration
    if configuration is not None:
        configuration = None if problems else replace(configuration, warnings=tuple(warnings))
    return examined._replace(configuration=configuration, problems=problems, warnings=warnings)


def _faults_at_zero(document: Document, model: ExternalModel) -> Iterator[Problem]:
    """What own kinematics does wrong at machine zero, where it needs no settings, whose values only gauges know."""
    if model.own is None or model.settings:
        return
    try:
        own_pose(model.own, np.zeros(model.links), {})
    except OwnKinematicsError as error:
        where = document.where(("geometry", "kinematics"))
        yield from (replace(problem, where=where, what=f"{problem.where} {problem.what}") for problem in error.problems)


def _dependences(document: Document, geometry: Geometry, wiring: Wiring) -> Iterator[Problem]:
    """Rods and hinges that say one thing twice, so that nothing holds the platform in one direction."""
    for names in dependences_as_drawn(machine_parts(geometry, wiring)):
        yield Problem(
            document.where(("geometry",)),
            f"{', '.join(names)} repeat or contradict each other at machine zero: something of the platform's six "
            "coordinates is held twice, and something not at all",
            next_step="look at `compd machine draw`; mend the joints, axes or actuators of these",
        )


def _section(kind: type[SectionT], document: Document, name: str) -> SectionT | None:
    """A section that has no problem; None where it has."""
    section = readable(kind, document.value((name,)))
    return section if isinstance(section, kind) else None


def _has_problem(problems: list[Problem]) -> bool:
    """Whether the geometry or the wiring, from which the machine is built, has a problem already."""
    return any(problem.where.rpartition(" ")[2].startswith(("geometry", "wiring")) for problem in problems)


def _at_machine_zero(
    error: Exception, document: Document, warnings: list[Problem], along: list[Problem]
) -> Iterator[Problem]:
    """What the kinematics finds impossible at machine zero, at the key that most likely is the reason."""
    found = error.problems if isinstance(error, KinematicsError) else (Problem("machine zero", str(error)),)
    in_metres = [warning for warning in warnings if warning.next_step.startswith(_IN_METRES)]
    for problem in found:
        location: Location = (
            ("geometry", "plate_points_M_mm") if problem.where.startswith("frame") else ("geometry", "tool")
        )
        where, value, next_step = document.where(location), "", problem.next_step
        if in_metres:
            where, value = in_metres[0].where, in_metres[0].value
            next_step = "in metres? all lengths are in mm" + (f"; or {next_step}" if next_step else "")
        elif along:
            where, value, next_step = along[0].where, along[0].value, f"mend the axis: {along[0].next_step}"
        yield Problem(where, f"{problem.where}: {problem.what}", value=value, next_step=next_step)


def _stroke_warnings(document: Document, geometry: Geometry, model: MachineModel) -> Iterator[Problem]:
    """Links that at machine zero are shorter or longer than any target may make them."""
    if geometry.link_length_mm is None:
        return
    shortest_mm, longest_mm = geometry.link_length_mm
    lengths_mm = model.zero.link_length_mm
    outside = [link for link, length_mm in enumerate(lengths_mm, start=1) if not shortest_mm <= length_mm <= longest_mm]
    if not outside:
        return
    in_metres = shortest_mm * 1e3 <= lengths_mm.min() and lengths_mm.max() <= longest_mm * 1e3
    links = f"link {outside[0]}" if len(outside) == 1 else f"links {', '.join(map(str, outside))}"
    yield Problem(
        document.where(("geometry", "link_length_mm")),
        f"{links} cannot be as long as at machine zero, {lengths_mm.min():.1f} to {lengths_mm.max():.1f} mm: "
        "targets will be refused",
        value=f"{shortest_mm:g} to {longest_mm:g} mm",
        allowed=f"from less than {lengths_mm.min():.1f} to more than {lengths_mm.max():.1f} mm",
        next_step="in metres? all lengths are in mm" if in_metres else "mend it, or the tool and joints",
    )
