"""The page of the configuration: every key of a machine's YAML file, from the models that check it."""

from __future__ import annotations

from collections import Counter

from pydantic import TypeAdapter

from compd.configuration import SECTIONS
from compd.configuration.machine_configuration import EXTERNAL_SECTIONS
from compd.configuration.plausible import PLAUSIBLE, PlausibleRange
from compd.gauge import GaugeOptions
from docs.generate.markdown import code, escape, heading, join, link, sentence, table, target, term
from docs.generate.schema import Key, ModelSchema, default_text, key_unit

INTRODUCTION = f"""\
A machine is described by one YAML file. `compd check FILE` reports every error in it at once, each with file, line,
key, value, what is allowed, and what to do. `compd check --schema > compd.schema.json` writes the JSON Schema, with
which an editor completes and checks keys while you type.

Lengths are in mm, angles in radians, times in seconds; a quantity's key ends in its unit. Before the unit stands the
coordinate frame of a vector: `M` is the surface plate, `B` the base platform, `B0` the base platform at
{term("machine zero")}, `P` the moving platform. A rotation is a rotation vector: the direction of its axis times the
angle. Links, joints and {term("comparator", "comparators")} count from 1. A key with the default "-" may be left
out. A key that is not listed here is an error. A machine without any gauge leaves `gauges`, `lines` and `wiring` out.

[Describe a machine](../how-to/describe-a-machine.md) goes through the sections in order.
"""
GAUGES = """\
The gauges, by name. Every other key belongs to the gauge's driver: see [gauges and drivers](gauges.md).
"""

PLAUSIBLE_VALUES = """\
A value outside of these ranges can be used, and `compd check` and `compd run` warn of it: there are machines of all
sizes, but most often it is a slip of the unit or of the decimal point, or a limit that would let a fault pass. `*`
stands for any name or entry.
"""


def page() -> str:
    """Markdown, from `SECTIONS`."""
    sections = [*SECTIONS, "gauges"]
    return join(
        "# Configuration of a machine",
        INTRODUCTION,
        table(
            ["section", "what it describes"],
            [[link(code(name), target("configuration", name)), escape(_meaning(name))] for name in sections],
        ),
        *(_section(name) for name in SECTIONS),
        *(_external_section(name) for name in EXTERNAL_SECTIONS),
        heading(2, "`gauges`", target("configuration", "gauges")),
        GAUGES,
        keys_table(ModelSchema(GaugeOptions).keys()),
        heading(2, "Plausible values", target("configuration", "plausible")),
        PLAUSIBLE_VALUES,
        table(["key", "plausible", "below", "above"], [_plausible(entry) for entry in PLAUSIBLE]),
        "## Example",
        "The tripod that compd ships with, `config/tripod-cmm.yaml`:",
        "```{literalinclude} ../../config/tripod-cmm.yaml\n:language: yaml\n```\n",
    )


def _plausible(entry: PlausibleRange) -> list[str]:
    reasons = [escape(sentence(reason)) if reason else "-" for reason in (entry.too_low, entry.too_high)]
    return [code(entry.key), f"{entry.lowest:g} to {entry.highest:g} {entry.unit}", *reasons]


def keys_table(keys: list[Key]) -> str:
    """Keys that a person writes: name, type with its unit, default, meaning."""
    return table(["key", "value", "default", "meaning"], [_row(key) for key in keys])


def _row(key: Key) -> list[str]:
    unit = key_unit(key.name)
    return [code(key.name), key.type_text + (f"; {unit}" if unit else ""), default_text(key), key.meaning]


def _meaning(name: str) -> str:
    if name == "gauges":
        return GAUGES.partition(".")[0] + "."
    schema = TypeAdapter(SECTIONS[name]).json_schema()
    return sentence(str(schema["description"]).partition("\n")[0])


def _section(name: str) -> str:
    """One section with all that is nested in it, each under its path in the file."""
    paths = _paths(name)
    schema = ModelSchema(SECTIONS[name], lambda model: link(code(paths[model]), target("configuration", paths[model])))
    blocks = [
        heading(2, code(name), target("configuration", name)),
        escape(sentence(schema.description(schema.schema))),
    ]
    if "properties" in schema.schema:
        blocks.append(keys_table(schema.keys()))
    else:
        blocks.append(f"Value: {schema.type_text(schema.schema)}.")
    for model, path in paths.items():
        blocks += [
            # the entries of a list stand under the section itself
            *([heading(3, code(path), target("configuration", path))] if path != name else []),
            escape(schema.description(schema.definitions[model])),
            keys_table(schema.keys(model)),
        ]
    return join(*blocks)


def _external_section(name: str) -> str:
    """The section as `machine: external` has it."""
    schema = ModelSchema(EXTERNAL_SECTIONS[name])
    return join(
        heading(2, f"{code(name)} of {code('machine: external')}", target("configuration", f"external.{name}")),
        escape(sentence(schema.description(schema.schema))),
        keys_table(schema.keys()),
    )


def _paths(section: str) -> dict[str, str]:
    """The models nested in a section, in the order of the file, and where each stands: base -> `geometry.base`."""
    schema = ModelSchema(SECTIONS[section])
    paths: dict[str, str] = {}

    def walk(properties: dict[str, dict[str, object]], path: str) -> None:
        for key, part in properties.items():
            models = schema.models(part)
            for model in models:
                definition = schema.definitions[model]
                nested = f"{path}.{key}" if key else path
                paths.setdefault(model, nested if len(models) == 1 else f"{nested} ({_choice(definition)})")
                walk(definition["properties"], nested)

    walk(dict(schema.schema.get("properties", {"": schema.schema})), section)
    doubled = {path for path, count in Counter(paths.values()).items() if count > 1}
    return {
        model: f"{path} ({next(iter(schema.definitions[model]['properties']))} ...)" if path in doubled else path
        for model, path in paths.items()
    }


def _choice(definition: dict[str, dict[str, dict[str, str]]]) -> str:
    """What tells the models of a union apart: `kind: serial`."""
    return next(f"{key}: {part['const']}" for key, part in definition["properties"].items() if "const" in part)
