"""The wire format of the daemon's sockets: one JSON object per line, with its name under "class".

Every message, in both directions, is one line of UTF-8 that ends with a newline. There is no null and no NaN: what is
unknown is left out. What a client may send is declared in `client_requests` and `local_requests`; what the
daemon sends is made by `Setpoint.to_json`, `ReadingsMessage`, `StatusReport` and the answers to the requests.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from enum import StrEnum
from typing import Any, NamedTuple, NoReturn, Self

from pydantic import ValidationError

from compd.text import encode_compact, holds_secret

PROTOCOL = 1
MAX_LINE_BYTES = 4096
# 1e9 mm is 1000 km: a number beyond it is not a coordinate, a rate or an angle.
MAX_NUMBER = 1e9
# How much of a faulty text is repeated in an error.
QUOTED_CHARACTERS = 40


class ErrorCode(StrEnum):
    """What was wrong with a request: `code` of an ERROR message. text : when it is sent, for people."""

    text: str

    def __new__(cls, name: str, text: str) -> Self:
        code = str.__new__(cls, name)
        code._value_ = name
        code.text = text
        return code

    BAD_JSON = "bad_json", "the line is not one JSON object; NaN and Infinity are not JSON either"
    LINE_TOO_LONG = "line_too_long", f"the line has more than {MAX_LINE_BYTES} bytes; it is skipped"
    UNKNOWN_CLASS = "unknown_class", "there is no such message"
    BAD_MESSAGE = "bad_message", "a key is missing, unknown, of the wrong type or out of range"
    ROLE_TAKEN = (
        "role_taken",
        "`TARGET` while another client is the controller, or from one that lost the role to the Unix socket",
    )
    NOT_CONTROLLER = (
        "not_controller",
        "`RELEASE` over TCP from a client that is not the controller, or while no client is",
    )
    UNIX_ONLY = "unix_only", "asked over TCP for what only the Unix socket allows"
    BUSY = "busy", "machine zero is being taken already, or another model is being read"
    ZERO_REFUSED = "zero_refused", "a gauge was not good, the machine moved, or the disk refused; `text` says which"
    ZERO_DIFFERS = (
        "zero_differs",
        "a gauge differs from the machine zero until now by more than 0.5 mm, or is not believed; `text` says which "
        "and by how much, and nothing has changed: ask with `replace` to take it all the same",
    )
    MODEL_REFUSED = (
        "model_refused",
        "the model file cannot be used: it is another machine's, or an effect lacks its gauge; `text` says every "
        "problem, and which gauge to add",
    )
    TOO_MANY_CLIENTS = (
        "too_many_clients",
        "no further client is accepted; sent instead of `VERSION`, then the connection is closed",
    )
    IDLE = "idle", "over TCP: watched nothing and asked nothing for a minute; then the connection is closed"
    NOT_AUTHORIZED = (
        "not_authorized",
        "over TCP where a token is configured: the first line was not `AUTH` with it; then the connection is closed",
    )


class ProtocolError(Exception):
    """A request that cannot be followed. The client gets an ERROR message, and its connection stays open."""

    def __init__(self, code: ErrorCode, text: str) -> None:
        super().__init__(text)
        self.code = code
        self.text = text

    def to_json(self) -> bytes:
        """The ERROR line."""
        return line({"class": "ERROR", "code": self.code, "text": self.text})


class ParsedLine(NamedTuple):
    """One line from a client: the request's name, and its other keys, not yet checked."""

    name: str
    keys: dict[str, Any]


def line(message: Mapping[str, Any]) -> bytes:
    """Encode one message, with its newline. Raises ValueError for a number that is not finite."""
    return encode_compact(message).encode() + b"\n"


def parse(data: bytes) -> ParsedLine:
    """Decode one line, given without its newline.

    Raises ProtocolError for anything that is not one JSON object with a text under "class".
    """
    try:
        message = json.loads(data.decode("utf-8"), parse_constant=_refuse_constant, object_pairs_hook=_keys_once)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(ErrorCode.BAD_JSON, f"not a JSON object: {error}") from error
    if not isinstance(message, dict):
        raise ProtocolError(ErrorCode.BAD_JSON, f"not a JSON object but {type(message).__name__}")
    name = message.pop("class", None)
    if not isinstance(name, str):
        raise ProtocolError(ErrorCode.BAD_MESSAGE, 'needs "class", a text')
    return ParsedLine(name, message)


def _keys_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; of a key that stands in it twice nobody knows which value is meant."""
    message = dict(pairs)
    if len(message) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key {twice!r} stands in it twice")
    return message


def _refuse_constant(name: str) -> NoReturn:
    """NaN and Infinity, which Python's decoder would accept, are no JSON."""
    raise ValueError(f"{name} is no number")


def bad_message(error: ValidationError, name: str, allowed: tuple[str, ...]) -> ProtocolError:
    """The error for keys that a request's model refused: the first of pydantic's, an unknown key before all others.

    name : the request's class; allowed : the keys that it has on this machine.
    """
    details = error.errors(include_url=False)
    detail = next((detail for detail in details if detail["type"] == "extra_forbidden"), details[0])
    value, context = detail["input"], detail.get("ctx", {})
    if holds_secret(allowed):  # whatever stands there may be the token, also under a key that is spelt wrongly
        return ProtocolError(ErrorCode.BAD_MESSAGE, f"{name} needs {', '.join(allowed)}, a text, and nothing else")
    if not detail["loc"] and detail["type"] == "string_unicode":  # the key itself
        return unknown_key(name, str(value), allowed)
    key = str(detail["loc"][0]) if detail["loc"] else name
    quoted = repr(value)[:QUOTED_CHARACTERS]
    match detail["type"]:
        case "extra_forbidden":
            return unknown_key(name, key, allowed)
        case "value_error":
            text = detail["msg"].removeprefix("Value error, ")
        case "int_type" | "float_type":
            text = f"{key} must be a number, is {type(value).__name__}"
        case "list_type" | "too_short" | "too_long":
            text = f"{key} must be a list of three numbers"
        case "greater_than_equal" if context["ge"] == 0:
            text = f"{key} is {quoted}, allowed 0 or more"
        case "greater_than_equal" | "less_than_equal":
            text = f"{key} must be within +-{MAX_NUMBER:g}"
        case "literal_error":
            allowed_texts = context["expected"].replace("'", "").replace(" or ", ", ")
            text = f"{key} is {quoted}, allowed: {allowed_texts}"
        case _:
            text = f"{key} is {quoted}: {detail['msg']}"
    return ProtocolError(ErrorCode.BAD_MESSAGE, text)


def unknown_key(name: str, key: str, allowed: tuple[str, ...]) -> ProtocolError:
    """The error for a key that a request does not have."""
    return ProtocolError(
        ErrorCode.BAD_MESSAGE,
        f"{name}: unknown key {key[:QUOTED_CHARACTERS]!r}, allowed: {', '.join(allowed) or 'none'}",
    )
