"""Sections of a YAML document as pydantic models, and pydantic's errors as Problems with line and next step."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from types import SimpleNamespace, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from compd.documents.document import Document, Location
from compd.errors import Problem
from compd.text import has_secret, holds_secret

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


def _printable(text: str) -> str:
    """The text itself; ValueError for characters that terminals or paths cannot contain."""
    if not text.isprintable():
        raise ValueError("must have printable characters only")
    return text


Text = Annotated[str, Field(min_length=1), AfterValidator(_printable)]
AbsolutePath = Annotated[str, Field(pattern=r"^/"), AfterValidator(_printable)]

_REFUSAL = "refusal"
# Messages for pydantic's errors of type, in the terms of a file.
_WHAT = {
    "model_type": "must be a section: `key: value` lines, indented",
    "model_attributes_type": "must be a section: `key: value` lines, indented",
    "dict_type": "must be a section: `name: ...` lines, indented",
    "tuple_type": "must be a list",
    "list_type": "must be a list",
    "string_type": "must be a text",
    "string_too_short": "must not be empty",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
}
# Patterns in words; others are shown as they are.
_PATTERNS = {
    "^/": "an absolute path, /...",
    "^[0-9a-f]{64}$": "64 hexadecimal digits, as `sha256sum FILE` prints them",
    r"^[78][NEO][12]$": "data bits, parity, stop bits: 8N1, 7E2, ...",
    r"^[a-z][a-z0-9_]*_(degC|N|hPa|pct|mm|1)$": "small letters with a unit: temperature_room_degC, force_N, ...",
    r"^[A-Za-z0-9_]+(\.[A-Za-z0-9_]+)?$": "gauge or gauge.channel, of letters, digits and _",
}
# Longest list or mapping (characters) repeated in a message; the line is enough to find a longer one.
_MAX_VALUE = 80


class Section(BaseModel):
    """A part of a document written by a person: unknown keys are refused, values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def refusal(what: str, allowed: str = "", next_step: str = "") -> PydanticCustomError:
    """An error for validators that becomes a Problem in exactly these words."""
    return PydanticCustomError(_REFUSAL, "{what}", {"what": what, "allowed": allowed, "next_step": next_step})


def validate(kind: Any, document: Document, location: Location, problems: list[Problem]) -> Any:
    """The value at `location` of the document as `kind`; None for a wrong one, with the reason in `problems`.

    kind : a pydantic model or any type that pydantic's TypeAdapter takes. A location that the document does not have
        is validated as None.
    """
    try:
        return TypeAdapter(kind).validate_python(document.value(location))
    except ValidationError as error:
        problems += validation_problems(error, document, location, kind)
        return None


def readable(kind: Any, value: Any) -> Any:
    """The readable part of `value` as `kind`, for checks in spite of other faults.

    A section with a faulty key becomes a namespace with the same attributes, None for what is missing or cannot be
    read; of a list or mapping the faulty entries do. None if nothing can be read.
    """
    try:
        return TypeAdapter(kind).validate_python(value)
    except ValidationError:
        pass
    if get_origin(kind) is Annotated:
        inner = get_args(kind)[0]
        # of a number or a text nothing is left where its limits do not hold
        return readable(inner, value) if get_origin(inner) in (tuple, dict, Union, UnionType) else None
    arguments = get_args(kind)
    if get_origin(kind) in (Union, UnionType) and isinstance(value, Mapping):
        kind = next((model for model in _models(kind) if _is_tagged(model, value)), None)
    if isinstance(kind, type) and issubclass(kind, Section) and isinstance(value, Mapping):
        return SimpleNamespace(
            **{name: _readable_field(field, name, value) for name, field in kind.model_fields.items()}
        )
    # of a vector nothing is left where a coordinate is wrong, of a list of entries the others are
    if get_origin(kind) is tuple and isinstance(value, list) and arguments[-1] is Ellipsis:
        return tuple(readable(arguments[0], entry) for entry in value)
    if get_origin(kind) is dict and isinstance(value, Mapping):
        return {name: readable(arguments[1], entry) for name, entry in value.items()}
    return None


def _readable_field(field: FieldInfo, name: str, section: Mapping[Any, Any]) -> Any:
    if name not in section:
        return None if field.is_required() else field.default
    kind = field.annotation
    return readable(Annotated[kind, *field.metadata] if field.metadata else kind, section[name])


def _is_tagged(model: type[BaseModel], value: Mapping[Any, Any]) -> bool:
    """Whether the mapping has the tag of this member of a union: `kind: serial`, `on: plate`."""
    return any(value.get(name) in get_args(field.annotation) for name, field in model.model_fields.items())


def validation_problems(error: ValidationError, document: Document, location: Location, kind: Any) -> list[Problem]:
    """Every error that pydantic found in the value at `location`, in the terms of the file.

    kind : the type that was validated; its models name the keys that are allowed beside an unknown one.
    """
    return [_problem(detail, document, location, kind) for detail in separate_errors(error)]


def separate_errors(error: ValidationError) -> list[ErrorDetails]:
    """pydantic's errors without consequential ones: a list with a faulty item also counts as too short."""
    details = error.errors(include_url=False)
    places = [detail["loc"] for detail in details]
    return [
        detail
        for detail in details
        if not any(len(place) > len(detail["loc"]) and place[: len(detail["loc"])] == detail["loc"] for place in places)
    ]


def unknown_key(document: Document, location: Location, allowed: Sequence[str]) -> Problem:
    """The problem of an unknown key, with the most similar allowed key.

    Its value is not shown: it may be a password, under whatever key somebody thought of.
    """
    close = difflib.get_close_matches(str(location[-1]), allowed, n=1, cutoff=0.6)
    return Problem(
        document.where(location),
        "unknown key",
        allowed=", ".join(allowed),
        next_step=f"did you mean `{close[0]}`?" if close else "remove it",
    )


def _problem(detail: ErrorDetails, document: Document, root: Location, kind: Any) -> Problem:
    location = _location_in_file(document, root, detail["loc"])
    where, value = document.where(location), document.value(location)
    context = detail.get("ctx", {})
    if detail["type"] == _REFUSAL:
        return Problem(
            where,
            context["what"],
            value="" if value is None else value_text(value, location),
            allowed=context["allowed"],
            next_step=context["next_step"],
        )
    if detail["type"] == "extra_forbidden":
        return unknown_key(document, location, _keys_beside(kind, detail["loc"]))
    if detail["loc"] and detail["loc"][-1] == "[key]":
        name = detail["loc"][-2]
        return Problem(
            where.removesuffix(".[key]"),
            "a name must be a text",
            value=repr(name),
            next_step=f"write it in quotes: '{name}'",
        )
    if detail["type"] == "missing" and detail["loc"] and isinstance(detail["loc"][-1], int):
        return Problem(
            document.where(location[:-1]), "has too few entries", value=value_text(detail["input"], location)
        )
    if detail["type"] == "missing":
        return Problem(where, "is missing", next_step=f"add `{location[-1]}:`")
    allowed = {
        "literal_error": str(context.get("expected", "")),
        "union_tag_invalid": str(context.get("expected_tags", "")),
        "union_tag_not_found": f"a key {context.get('discriminator', '')}",
        "greater_than": f"greater than {context.get('gt')}",
        "greater_than_equal": f"{context.get('ge')} or more",
        "less_than_equal": f"{context.get('le')} or less",
        "string_pattern_mismatch": _PATTERNS.get(pattern := str(context.get("pattern")), f"the pattern {pattern}"),
        "finite_number": "a finite number",
    }.get(detail["type"], "")
    message = detail["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
    if detail["type"] == "string_pattern_mismatch" and pattern in _PATTERNS:
        message = "is not what it must be"
    what = _WHAT.get(detail["type"], message)
    shown = value_text(value, location)
    step = _remedy(what, value) if shown else ""
    return Problem(where, what, value=shown, allowed=allowed, next_step=step)


def _remedy(what: str, value: Any) -> str:
    """The correct value, if it is clear."""
    if isinstance(value, str) and "number" in what and re.fullmatch(r"[-+]?\d+,\d+", value):
        return f"write {value.replace(',', '.')}, with a point"
    if what == "must be a text" and isinstance(value, int | float):
        return f"write it in quotes: '{value}'"
    return ""


def value_text(value: Any, location: Location = ()) -> str:
    """A value as shown in a problem; "" for a long one, which the line finds, and for a secret."""
    if holds_secret(location) or has_secret(value):
        return ""
    text = repr(value)
    if len(text) <= _MAX_VALUE:
        return text
    return "" if isinstance(value, dict | list) else f"{text[:_MAX_VALUE]} ..."


def _location_in_file(document: Document, root: Location, loc: Location) -> Location:
    """pydantic's location below `root`, without the union tags in it, which are no keys of the file."""
    location = root
    for i, part in enumerate(loc):
        here = document.value(location)
        in_mapping = isinstance(here, dict) and (part in here or i == len(loc) - 1)
        if in_mapping or (isinstance(here, list) and isinstance(part, int)):
            location = (*location, part)
    return location


def _keys_beside(kind: Any, loc: Location) -> list[str]:
    """The keys that the section around `loc` allows, by descending from `kind` along the location."""
    for part in loc[:-1]:
        kind = _kind_below(kind, part)
    models = _models(kind)
    return [field.alias or name for name, field in models[0].model_fields.items()] if models else []


def _kind_below(kind: Any, part: str | int) -> Any:
    """The type of what `part` names: a field, the member of a tagged union, or the entry of a list or mapping."""
    for model in _models(kind):
        if part in model.model_fields:
            return model.model_fields[str(part)].annotation
        if any(part in get_args(field.annotation) for field in model.model_fields.values()):
            return model
    return kind


def _models(kind: Any) -> list[type[BaseModel]]:
    """Every pydantic model in a type: itself, or the arguments of a union, a list, a mapping."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return [kind]
    return [model for argument in get_args(kind) for model in _models(argument)]
