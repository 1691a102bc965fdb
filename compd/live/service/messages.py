"""The socket's messages: one JSON object per line. Here they are read and checked; nothing here does I/O."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NoReturn

from compd.json_text import encode_compact
from compd.live.loop.commands import Target

PROTOCOL = 1
MAX_LINE_BYTES = 4096
# 1e9 mm is 1000 km: a number beyond it is not a coordinate, a rate or an angle.
_LARGEST_NUMBER = 1e9


class ErrorCode(StrEnum):
    """What was wrong with a message."""

    BAD_JSON = "bad_json"  # not one JSON object on one line
    LINE_TOO_LONG = "line_too_long"
    UNKNOWN_CLASS = "unknown_class"
    BAD_MESSAGE = "bad_message"  # a key is missing, unknown, or of the wrong type
    ROLE_TAKEN = "role_taken"  # another client is the controller
    NOT_CONTROLLER = "not_controller"
    UNIX_ONLY = "unix_only"  # asked over TCP for what only the Unix socket allows
    BUSY = "busy"
    ZERO_REFUSED = "zero_refused"
    MODEL_REFUSED = "model_refused"
    TOO_MANY_CLIENTS = "too_many_clients"


class ProtocolError(Exception):
    """A message that cannot be followed; the connection stays."""

    def __init__(self, code: ErrorCode, text: str) -> None:
        super().__init__(text)
        self.code = code
        self.text = text

    def to_json(self) -> bytes:
        """The ERROR line."""
        return line({"class": "ERROR", "code": self.code, "text": self.text})


@dataclass(frozen=True)
class TargetKeys:
    """What a TARGET carries on this machine: `tip` is tip_B0_mm, or tip_P_mm with the tool on the plate."""

    tip: str
    rotation: bool  # a hexapod's attitude may be given as rotation_B0_rad


@dataclass(frozen=True)
class ModelOrder:
    """Which model file to adopt, or to run as a shadow; file "" is none."""

    file: str
    shadow: bool


def line(message: Mapping[str, Any]) -> bytes:
    """One message as it goes over the wire."""
    return encode_compact(message).encode() + b"\n"


def parse(data: bytes) -> dict[str, Any]:
    """One line (without its newline) to a message with a known type of `class`.

    Raises ProtocolError for anything that is not one JSON object with a text `class`.
    """
    try:
        message = json.loads(data.decode("utf-8"), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise ProtocolError(ErrorCode.BAD_JSON, f"not a JSON object: {error}") from error
    if not isinstance(message, dict):
        raise ProtocolError(ErrorCode.BAD_JSON, f"not a JSON object but {type(message).__name__}")
    if not isinstance(message.get("class"), str):
        raise ProtocolError(ErrorCode.BAD_MESSAGE, 'needs "class", a text')
    return message


def parse_watch(message: Mapping[str, Any]) -> tuple[float, bool]:
    """WATCH: how many per second (inf for every one, 0 for none), and whether of the readings, not the setpoints."""
    _only(message, ("rate_hz", "what"))
    what = message.get("what", "setpoints")
    if what not in ("setpoints", "readings"):
        raise ProtocolError(ErrorCode.BAD_MESSAGE, f"what is {str(what)[:40]!r}, allowed: setpoints, readings")
    readings = what == "readings"
    if "rate_hz" not in message:
        return math.inf, readings
    rate_hz = _number(message["rate_hz"], "rate_hz")
    if rate_hz < 0:
        raise ProtocolError(ErrorCode.BAD_MESSAGE, f"rate_hz is {rate_hz:g}, allowed 0 or more")
    return rate_hz, readings


def parse_target(message: Mapping[str, Any], keys: TargetKeys) -> Target:
    """TARGET for a machine that takes `keys`."""
    _only(message, (keys.tip, "rotation_B0_rad") if keys.rotation else (keys.tip,))
    if keys.tip not in message:
        raise ProtocolError(ErrorCode.BAD_MESSAGE, f"needs {keys.tip}, three numbers")
    rotation = message.get("rotation_B0_rad")
    return Target(
        _vector(message[keys.tip], keys.tip), None if rotation is None else _vector(rotation, "rotation_B0_rad")
    )


def parse_model(message: Mapping[str, Any]) -> ModelOrder | None:
    """MODEL with an order; None for the bare question."""
    _only(message, ("file", "shadow"))
    if set(message) == {"class"}:
        return None
    file, shadow = message.get("file"), message.get("shadow", False)
    if not isinstance(file, str) or not isinstance(shadow, bool):
        raise ProtocolError(ErrorCode.BAD_MESSAGE, "needs file, a text (shadow: true or false)")
    if file and not file.startswith("/"):
        raise ProtocolError(ErrorCode.BAD_MESSAGE, f'file is {file[:200]!r}, allowed: an absolute path, or "" for none')
    return ModelOrder(file, shadow)


def parse_bare(message: Mapping[str, Any]) -> None:
    """A message that is its class alone: STATUS, RELEASE, ZERO."""
    _only(message, ())


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number")


def _only(message: Mapping[str, Any], keys: tuple[str, ...]) -> None:
    unknown = sorted(set(message) - {"class", *keys})
    if unknown:
        allowed = ", ".join(keys) or "none"
        raise ProtocolError(
            ErrorCode.BAD_MESSAGE, f"{message['class']}: unknown key {unknown[0][:40]!r}, allowed: {allowed}"
        )


def _number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ProtocolError(ErrorCode.BAD_MESSAGE, f"{name} must be a number, is {type(value).__name__}")
    if not -_LARGEST_NUMBER <= value <= _LARGEST_NUMBER:  # compares huge integers without converting them
        raise ProtocolError(ErrorCode.BAD_MESSAGE, f"{name} must be within +-{_LARGEST_NUMBER:g}")
    return float(value)


def _vector(value: Any, name: str) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != 3:
        raise ProtocolError(ErrorCode.BAD_MESSAGE, f"{name} must be a list of three numbers")
    return tuple(_number(part, name) for part in value)
