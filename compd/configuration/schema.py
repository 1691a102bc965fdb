"""The JSON Schema of a configuration, for editors, from the same models that validate the file."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from compd.configuration.machine_configuration import (
    EXTERNAL_SECTIONS,
    GAUGE_SECTIONS,
    OPTIONAL_SECTIONS,
    SECTIONS,
)
from compd.plugins import GAUGES, load, names


def json_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a configuration, with the options of every installed driver."""
    definitions: dict[str, Any] = {}
    properties: dict[str, Any] = {}
    for name, kind in SECTIONS.items():
        properties[name] = _collect(kind, definitions)
    for name, kind in EXTERNAL_SECTIONS.items():
        forms = [properties[name], _collect(kind, definitions)]
        properties[name] = {"description": forms[0]["description"], "anyOf": forms}
    gauges = []
    for driver in names(GAUGES):
        options = _collect(load(GAUGES, driver, driver).Options, definitions)
        options.setdefault("properties", {})["driver"] = {"const": driver}
        gauges.append(options)
    by_path = {
        "type": "object",
        "required": ["driver", "line"],
        "properties": {"driver": {"type": "string", "pattern": r"^/.+\.py:[A-Za-z_]\w*$"}},
    }
    properties["gauges"] = {
        "description": "The gauges, by name. `driver` and `line` are common to all; every other key is the driver's.",
        "type": "object",
        "additionalProperties": {"oneOf": [*gauges, by_path]},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "compd machine configuration",
        "type": "object",
        "additionalProperties": False,
        "required": [name for name in SECTIONS if name not in {*OPTIONAL_SECTIONS, *GAUGE_SECTIONS}],
        "dependentRequired": {"gauges": [*GAUGE_SECTIONS]},
        "properties": properties,
        "$defs": definitions,
    }


def _collect(kind: Any, definitions: dict[str, Any]) -> dict[str, Any]:
    """The schema of one model or type; its own definitions are added to `definitions`."""
    part = TypeAdapter(kind).json_schema(ref_template="#/$defs/{model}")
    definitions.update(part.pop("$defs", {}))
    return part
