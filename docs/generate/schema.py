"""Keys of pydantic models as rows of a table, from their JSON Schema. This module is no page."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from pydantic import TypeAdapter

from compd.units import unit_of
from docs.generate.markdown import code, codes, escape

Schema = Mapping[str, Any]
# How units are written, where that is not how a name ends in them.
_SHOWN_UNITS = {"mm_per_s": "mm/s", "hz": "Hz", "pct": "%", "mb": "MB"}
# An attribute in a docstring, `name : text`, with its further lines.
_ATTRIBUTE = re.compile(r"^(\w+(?:, \w+)*) : (.*(?:\n    .*)*)", re.MULTILINE)
_FRAME_LETTERS = ("_B", "_P", "_M", "_B0")


class Key(NamedTuple):
    """One key: `type_text` and `meaning` in Markdown; `default` as JSON, "" where the key is needed."""

    name: str
    type_text: str
    default: str
    meaning: str

    @property
    def needed(self) -> bool:
        return not self.default


class ModelSchema:
    """The schema of a type, with the names of the models in it."""

    def __init__(self, kind: Any, refer: Callable[[str], str] = code) -> None:
        """`refer`: how another model is referred to by its name, for instance by a link."""
        self.schema: Schema = TypeAdapter(kind).json_schema(by_alias=True)
        definitions: Mapping[str, Schema] = self.schema.get("$defs", {})
        self.definitions = {name: _with_attributes(definition) for name, definition in definitions.items()}
        self._refer = refer

    def keys(self, definition: str = "") -> list[Key]:
        """The keys of a model: of the type itself, or of the definition of that name."""
        schema = self.resolve(self.definitions[definition] if definition else self.schema)
        needed = schema.get("required", ())
        return [
            Key(
                name,
                self.type_text(part),
                "" if name in needed else json.dumps(part.get("default"), ensure_ascii=False),
                escape(self.description(part)),
            )
            for name, part in schema.get("properties", {}).items()
        ]

    def description(self, part: Schema) -> str:
        """The description of a key, or of the model that it holds."""
        if "description" in part:
            return str(part["description"])
        resolved = self.resolve(part)
        return str(resolved.get("description", "")) if resolved is not part else ""

    def resolve(self, part: Schema) -> Schema:
        """What a reference stands for; anything else as it is."""
        if "$ref" in part:
            return self.definitions[part["$ref"].rpartition("/")[2]]
        return part

    def models(self, part: Schema) -> list[str]:
        """Names of the models (not enumerations) that stand in a key's type, in their order."""
        names: list[str] = []
        if "$ref" in part:
            name = part["$ref"].rpartition("/")[2]
            names += [name] if "properties" in self.definitions[name] else []
        for inside in ("anyOf", "oneOf", "prefixItems"):
            names += [name for option in part.get(inside, ()) for name in self.models(option)]
        for inside_part in (part.get("items", {}), self._values(part)):
            names += self.models(inside_part) if inside_part else []
        return list(dict.fromkeys(names))

    def type_text(self, part: Schema) -> str:
        """What a value may be, in words."""
        if "$ref" in part:
            name = part["$ref"].rpartition("/")[2]
            definition = self.definitions[name]
            return self._refer(name) if "properties" in definition else self.type_text(definition)
        for union in ("anyOf", "oneOf"):
            if union in part:
                options = [option for option in part[union] if option.get("type") != "null"]
                if {option.get("type") for option in options} == {"integer", "number"}:
                    return _number_text({**part, "type": "number"})
                return " or ".join(dict.fromkeys(map(self.type_text, options)))
        if "const" in part:
            return code(part["const"])
        if "enum" in part:
            return codes(part["enum"])
        kind = part.get("type")
        if kind == "array":
            return self._list_text(part)
        if kind == "object":
            values = self._values(part)
            return f"mapping of names to {_plural(self.type_text(values))}" if values else "mapping"
        if kind in ("number", "integer"):
            return _number_text(part)
        if kind == "string":
            return f"text, pattern {code(part['pattern'])}" if "pattern" in part else "text"
        return {"boolean": "true or false", "null": "nothing"}.get(kind or "", "any value")

    def _values(self, part: Schema) -> Schema:
        """The schema of the values of a mapping; {} where they may be anything, or for any other type."""
        values = part.get("additionalProperties")
        patterns = part.get("patternProperties", {})
        return values if isinstance(values, dict) else next(iter(patterns.values()), {})

    def _list_text(self, part: Schema) -> str:
        fixed = part.get("prefixItems", ())
        if fixed:
            texts = list(dict.fromkeys(map(self.type_text, fixed)))
            return f"{len(fixed)} {_plural(texts[0])}" if len(texts) == 1 else f"list of {' and '.join(texts)}"
        item = _plural(self.type_text(part.get("items", {})))
        item = item.removeprefix("lists of ") if item[9:10].isdigit() else item
        item += " each" if item[:1].isdigit() else ""
        least, most = part.get("minItems", 0), part.get("maxItems")
        if most is not None:
            return f"{least} {item}" if least == most else f"{least} to {most} {item}"
        return f"list of {item}" + (f", {least} or more" if least else "")


def _with_attributes(definition: Schema) -> Schema:
    """The schema of a class whose docstring describes its attributes, with these descriptions at its keys."""
    text, keys = definition.get("description", ""), dict(definition.get("properties", {}))
    for names, meaning in _ATTRIBUTE.findall(text):
        for name in names.split(", "):
            if name in keys and "description" not in keys[name]:
                keys[name] = {**keys[name], "description": re.sub(r"\s+", " ", meaning).removesuffix(".")}
    if keys == definition.get("properties", {}):
        return definition
    about = re.split(r"\n+(?:Attributes\n-+\n)?(?=\w+(?:, \w+)* : )", text, maxsplit=1)[0]
    return {**definition, "description": about, "properties": keys}


def key_unit(name: str) -> str:
    """The unit in which a key's name ends; "" if in none."""
    unit = "Hz" if name.endswith("_hz") else unit_of(name)
    return _SHOWN_UNITS.get(unit, unit)


def default_text(key: Key) -> str:
    """The default of a key that a person writes."""
    if key.needed:
        return "needed"
    return "-" if key.default in ("null", "[]", "{}", '""', "NaN") else code(key.default.strip('"'))


def _plural(text: str) -> str:
    if text.startswith("number"):
        return "numbers" + text.removeprefix("number")
    if text.startswith("whole number"):
        return "whole numbers" + text.removeprefix("whole number")
    if text.startswith("text"):
        return "texts" + text.removeprefix("text")
    if text.startswith("list of "):
        return "lists of " + text.removeprefix("list of ")
    return f"lists of {text}" if text[:1].isdigit() else text


def _number_text(part: Schema) -> str:
    text = "whole number" if part["type"] == "integer" else "number"
    low, high, above = (
        "" if (bound := part.get(key)) is None else format(bound, ".7g")
        for key in ("minimum", "maximum", "exclusiveMinimum")
    )
    if above:
        return f"{text} above {above}" + (f", {high} at most" if high else "")
    if low and high:
        return f"{text}, {low} to {high}"
    return f"{text}, {low} or more" if low else f"{text}, {high} at most" if high else text
