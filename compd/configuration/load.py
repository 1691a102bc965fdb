"""From a file to a Configuration, or to every problem in it at once."""

from __future__ import annotations

import difflib
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from compd.configuration import crosscheck
from compd.configuration.document import Document, Location, read
from compd.configuration.geometry import Geometry
from compd.configuration.lines import LineSettings
from compd.configuration.operation import LimitSettings, LoopSettings, SocketSettings, StateSettings, Wiring
from compd.errors import ConfigurationError, PluginError, Problem
from compd.gauge import Gauge, GaugeOptions
from compd.plugins import GAUGES
from compd.plugins import load as load_plugin

SECTIONS: Mapping[str, Any] = {
    "machine": str,
    "geometry": Geometry,
    "lines": dict[str, LineSettings],
    "wiring": Wiring,
    "loop": LoopSettings,
    "limits": LimitSettings,
    "sockets": SocketSettings,
    "state": StateSettings,
}


@dataclass(frozen=True)
class Configuration:
    """A whole machine, checked. `gauges` holds each driver's own options, with `.driver` and `.line`."""

    path: Path
    machine: str
    geometry: Geometry
    lines: Mapping[str, LineSettings]
    gauges: Mapping[str, GaugeOptions]
    drivers: Mapping[str, type[Gauge[Any]]]
    wiring: Wiring
    loop: LoopSettings
    limits: LimitSettings
    sockets: SocketSettings
    state: StateSettings
    warnings: tuple[Problem, ...] = ()

    def gauge_objects(self) -> dict[str, Gauge[Any]]:
        """A fresh driver object for every gauge."""
        return {name: self.drivers[name](options) for name, options in self.gauges.items()}

    @property
    def config_hash(self) -> str:
        """Of everything in the file: tells a client whether two daemons run the same configuration."""
        return _hash(self, ("machine", "geometry", "lines", "gauges", "wiring", "loop", "limits", "sockets", "state"))

    @property
    def geometry_hash(self) -> str:
        """Of what a model is fitted on: the geometry, without what only limits it."""
        return _hash(self, ("geometry",), without=("link_length_mm",))

    @property
    def zero_hash(self) -> str:
        """Of what machine zero depends on: geometry, gauges and wiring, but no port, rate, limit or noise."""
        return _hash(self, ("machine", "geometry", "gauges", "wiring"), without=("noise_um", "noise"))


def load(path: Path) -> Configuration:
    """Read and check a configuration.

    Raises ConfigurationError with every problem: file, line, key, value, what is allowed, next step.
    """
    document = read(path)
    problems: list[Problem] = []
    known = [*SECTIONS, "gauges"]
    problems += [_unknown(document, (key,), known) for key in document.data if key not in known]
    found: dict[str, Any] = {}
    for name, kind in SECTIONS.items():
        if name not in document.data:
            problems.append(Problem(where=str(path), what=f"section `{name}` is missing", next_step=f"add `{name}:`"))
            continue
        try:
            found[name] = TypeAdapter(kind).validate_python(document.data[name])
        except ValidationError as error:
            problems += [_problem(document, (name,), kind, detail) for detail in error.errors(include_url=False)]
    gauges, drivers = _gauges(document, problems)
    parts = crosscheck.Parts(document, found.get("geometry"), found.get("lines"), gauges, drivers, found.get("wiring"))
    problems += crosscheck.problems(parts)
    if problems:
        raise ConfigurationError(sorted(set(problems), key=lambda problem: _line_number(problem.where)))
    return Configuration(path, gauges=gauges, drivers=drivers, warnings=tuple(crosscheck.warnings(parts)), **found)


def _gauges(document: Document, problems: list[Problem]) -> tuple[dict[str, GaugeOptions], dict[str, type[Gauge[Any]]]]:
    """Each gauge's options, checked by its own driver's model; a faulty gauge is left out and its problems noted."""
    gauges: dict[str, GaugeOptions] = {}
    drivers: dict[str, type[Gauge[Any]]] = {}
    section = document.data.get("gauges")
    if not isinstance(section, dict) or not section:
        problems.append(
            Problem(
                where=document.where(("gauges",)),
                what="section `gauges` is missing or empty",
                next_step="add `gauges:` with one entry per device",
            )
        )
        return gauges, drivers
    for name, raw in section.items():
        location: Location = ("gauges", name)
        if not isinstance(raw, dict) or not isinstance(raw.get("driver"), str):
            problems.append(
                Problem(
                    where=document.where(location),
                    what="needs `driver:`",
                    value=str(raw),
                    next_step="`compd check --drivers` lists them",
                )
            )
            continue
        try:
            driver = load_plugin(GAUGES, raw["driver"], document.where((*location, "driver")))
            gauges[name] = driver.Options.model_validate(raw)
            drivers[name] = driver
        except PluginError as error:
            problems += error.problems
        except ValidationError as error:
            problems += [
                _problem(document, location, driver.Options, detail) for detail in error.errors(include_url=False)
            ]
    return gauges, drivers


def _problem(document: Document, root: Location, kind: Any, detail: ErrorDetails) -> Problem:
    """One pydantic error in the person's own terms."""
    location = _in_file(document, root, detail["loc"])
    context = detail.get("ctx", {})
    if detail["type"] == "extra_forbidden":
        return _unknown(document, location, _keys_beside(kind, detail["loc"]))
    if detail["type"] == "missing":
        return Problem(where=document.where(location), what="is missing", next_step=f"add `{location[-1]}:`")
    allowed = {
        "literal_error": str(context.get("expected", "")),
        "union_tag_invalid": str(context.get("expected_tags", "")),
        "union_tag_not_found": f"a key {context.get('discriminator', '')}",
        "greater_than": f"greater than {context.get('gt')}",
        "greater_than_equal": f"{context.get('ge')} or more",
        "less_than_equal": f"{context.get('le')} or less",
        "string_pattern_mismatch": f"the pattern {context.get('pattern')}",
        "finite_number": "a finite number",
    }.get(detail["type"], "")
    message = detail["msg"].removeprefix("Value error, ")
    value = document.value(location)
    shown = "" if isinstance(value, dict | list) and len(str(value)) > 80 else repr(value)
    return Problem(where=document.where(location), what=message, value=shown, allowed=allowed)


def _in_file(document: Document, root: Location, loc: Location) -> Location:
    """pydantic's location without the union tags that it puts between, which are not in the file."""
    location = root
    for i, part in enumerate(loc):
        here = document.value(location)
        inside = isinstance(here, dict) and (part in here or i == len(loc) - 1)
        if inside or (isinstance(here, list) and isinstance(part, int)):
            location = (*location, part)
    return location


def _unknown(document: Document, location: Location, allowed: list[str]) -> Problem:
    close = difflib.get_close_matches(str(location[-1]), allowed, n=1, cutoff=0.6)
    return Problem(
        where=document.where(location),
        what="unknown key",
        value=repr(document.value(location)),
        allowed=", ".join(allowed),
        next_step=f"did you mean `{close[0]}`?" if close else "remove it",
    )


def _keys_beside(kind: Any, loc: Location) -> list[str]:
    """The keys that the section around `loc` allows, found by walking the models along it."""
    for part in loc[:-1]:
        kind = _step(kind, part)
    models = _models(kind)
    return [field.alias or name for name, field in models[0].model_fields.items()] if models else []


def _step(kind: Any, part: str | int) -> Any:
    """What stands below `part`: a field's type, the member of a union with that tag, or an entry's type."""
    for model in _models(kind):
        if part in model.model_fields:
            return model.model_fields[str(part)].annotation
        if any(part in get_args(field.annotation) for field in model.model_fields.values()):
            return model
    return kind


def _models(kind: Any) -> list[type[BaseModel]]:
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return [kind]
    return [model for argument in get_args(kind) for model in _models(argument)]


def _line_number(where: str) -> int:
    head = where.split(" ", maxsplit=1)[0].rsplit(":", 1)
    return int(head[1]) if len(head) == 2 and head[1].isdigit() else 0


def _hash(configuration: Configuration, fields: tuple[str, ...], without: tuple[str, ...] = ()) -> str:
    def plain(value: Any) -> Any:
        if isinstance(value, BaseModel):
            value = value.model_dump(mode="json")
        if isinstance(value, Mapping):
            return {k: plain(v) for k, v in value.items() if k not in without}
        return [plain(v) for v in value] if isinstance(value, list) else value

    text = json.dumps({name: plain(getattr(configuration, name)) for name in fields}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
