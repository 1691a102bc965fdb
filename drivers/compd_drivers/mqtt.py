r"""MQTT gauge: values published on a topic by a device or a gateway; a plain number, or JSON with a path.

A plain number, which its device publishes ten times a second, whether or not it has changed:

    gauges:
      joint_1: {driver: mqtt, line: broker, period_s: 0.1,
                channels: [{name: value, topic: cell/joint1, unit: mm, range: [-1, 1]}]}

JSON such as `{"t": "2026-11-23T18:00:00.120Z", "probe": {"um": 12.34, "state": "ok"}}`:

    channels: [{name: value, topic: cell/joint1, value: /probe/um, unit: um, range: [-1, 1], time: /t,
                status: {at: /probe/state, ok: [ok]}}]

A path is a JSON Pointer (RFC 6901): `/a/b/0` is the first entry of `b` in `a`. A number is a JSON number, or the whole
payload; text, true, an absent key and a payload of another form are `mismatch`, null is `sensor_fault`.

MQTT itself sends no time. Either the payload has one (`time`), of a clock that agrees with this computer's, or the time
is that of the arrival, and the device must publish at least every `period_s`: what comes after a longer pause may have
been held up on its way, and counts again after one more period. A retained message without a time is never used.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, field_validator, model_validator

from compd.gauge import Channel, GaugeOptions, LineFault, LineKind, OptionDoubt, Quality, Reading, bad
from compd.pushed_gauge import Message, PushedGauge, PushedGaugeOptions, Stamp
from compd_drivers.measured import RANGE_OPTION, DescriptionSection, MeasuredChannel, doubts, repeated

Pointer = str
_POINTER = r"^(/([^/~]|~[01])*)*$"
_NUMBER = re.compile(rb"\s*([+-]?[0-9]+(\.[0-9]*)?([eE][+-]?[0-9]+)?)\s*")
_NOT_FINITE = re.compile(rb"\s*[+-]?(nan|inf|infinity)\s*", re.IGNORECASE)
_FRACTION = re.compile(r"[T ]\d\d:?\d\d:?\d\d[.,](\d+)")
_UNITS_S: Mapping[str, float] = {"unix_s": 1.0, "unix_ms": 1e-3, "unix_us": 1e-6, "unix_ns": 1e-9}
# Valid times (s since 1970): the years 2000 to 2100. A clock that was never set shows 1970.
_EARLIEST_S, _LATEST_S = 946684800.0, 4102444800.0
SHOWN_BYTES = 60  # of a payload, in a fault's detail


class MqttStatus(DescriptionSection):
    """The part of the payload with the value's validity."""

    at: Pointer = Field(pattern=_POINTER, description="where it stands, as a JSON Pointer")
    ok: tuple[str | bool | int, ...] = Field(min_length=1, description="what it says when the value counts")


class MqttChannel(MeasuredChannel):
    """One value: its topic, and its position in the payload."""

    topic: str = Field(min_length=1, description="without wildcards")
    value: Pointer = Field(
        default="", pattern=_POINTER, description="JSON Pointer to the number; left out: the payload is the number"
    )
    time: Pointer | None = Field(
        default=None, pattern=_POINTER, description="JSON Pointer to the time of measurement; omitted for none"
    )
    time_format: Literal["iso8601", "unix_s", "unix_ms", "unix_us", "unix_ns"] = Field(
        default="iso8601", description="iso8601: text with Z or another offset from UTC; unix: a number since 1970, UTC"
    )
    status: MqttStatus | None = Field(default=None, description="what the payload says of the value")

    @field_validator("topic")
    @classmethod
    def _is_one_topic(cls, topic: str) -> str:
        if set(topic) & set("+#\0"):
            raise ValueError("a gauge has one topic, without the wildcards + and #")
        return topic

    @model_validator(mode="after")
    def _is_a_document(self) -> Self:
        if not self.value and (self.time is not None or self.status is not None):
            raise ValueError("`time` and `status` stand in a document: `value` says where the number is in it")
        return self


class MqttOptions(PushedGaugeOptions):
    """Options of an MQTT gauge."""

    channels: tuple[MqttChannel, ...] = Field(min_length=1, description="the values, each with its topic")
    period_s: float | None = Field(
        default=None,
        gt=0,
        allow_inf_nan=False,
        description="longest period of publishing, changed or not; needed if a channel has no time",
    )

    @model_validator(mode="after")
    def _has_times(self) -> Self:
        if doubled := repeated([channel.name for channel in self.channels]):
            raise ValueError(f"channel named twice: {doubled}")
        timeless = [c.name for c in self.channels if c.time is None or self.time_from == "arrival"]
        if timeless and self.period_s is None:
            raise ValueError(f"`period_s` is needed: {', '.join(timeless)} has the time of its arrival")
        return self


class Mqtt(PushedGauge):
    """Values that a device or gateway publishes on MQTT topics, as a plain number or in JSON."""

    Options: ClassVar[type[GaugeOptions]] = MqttOptions
    line_kind: ClassVar[LineKind] = "topics"
    range_option: ClassVar[str] = RANGE_OPTION
    sample_options: ClassVar[Mapping[str, Any]] = {
        "channels": [
            {
                "name": "value",
                "topic": "cell/joint_1",
                "value": "/probe/um",
                "time": "/t",
                "status": {"at": "/probe/state", "ok": ["ok"]},
                "unit": "um",
                "range": [-1, 1],
            }
        ]
    }
    silence_hint = "is it published at all, and may this user read it?"

    def __init__(self, options: MqttOptions) -> None:
        self._described = options.channels
        super().__init__(options)
        self._parsed: tuple[bytes, Any] = (b"", None)  # of the last payload: several channels may read it

    @property
    def channels(self) -> Sequence[Channel]:
        return [described.channel for described in self._described]

    def doubts(self) -> Iterable[OptionDoubt]:
        return doubts(self._described, self.range_option)

    @property
    def addresses(self) -> Sequence[str]:
        return [described.topic for described in self._described]

    @property
    def period_s(self) -> float | None:
        period_s: float | None = self.options.period_s
        return period_s

    def stamp(self, index: int, message: Message) -> Stamp:
        """The time in the payload. Raises LineFault (MISMATCH) if a required one is missing."""
        described = self._described[index]
        if described.time is None or self.options.time_from == "arrival":
            return Stamp(math.nan)
        value = _at(self._json(message), described.time)
        stamp = _iso_time(value) if described.time_format == "iso8601" else _unix_time(value, described.time_format)
        if stamp is None or not _EARLIEST_S <= stamp.utc_s <= _LATEST_S:
            raise LineFault(Quality.MISMATCH, f"no time in {described.time_format}: {value!r}"[:SHOWN_BYTES])
        return stamp

    def decode(self, index: int, message: Message, time_s: float) -> Reading:
        described = self._described[index]
        if described.status is not None:
            status = _at(self._json(message), described.status.at)
            if not any(status == ok and type(status) is type(ok) for ok in described.status.ok):
                return bad(time_s, Quality.DEVICE_ERROR, f"{described.status.at} is {status!r}"[:SHOWN_BYTES])
        if not described.value:
            return _number_reading(described, message.payload, time_s)
        value = _at(self._json(message), described.value)
        if value is None:
            return bad(time_s, Quality.SENSOR_FAULT, f"{described.value} is null")
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise LineFault(Quality.MISMATCH, f"{described.value} is no number: {value!r}"[:SHOWN_BYTES])
        return described.reading(_as_float(value), time_s)

    def _json(self, message: Message) -> Any:
        """Raises LineFault (MISMATCH)."""
        if message.payload != self._parsed[0]:
            try:
                self._parsed = (message.payload, json.loads(message.payload))
            except (ValueError, RecursionError) as error:
                text = f"no JSON: {message.payload[:SHOWN_BYTES]!r}"
                raise LineFault(Quality.MISMATCH, text) from error
        return self._parsed[1]


def _number_reading(described: MqttChannel, payload: bytes, time_s: float) -> Reading:
    """Raises LineFault (MISMATCH)."""
    if _NUMBER.fullmatch(payload):
        return described.reading(float(payload), time_s)
    shown = repr(payload[:SHOWN_BYTES])
    if _NOT_FINITE.fullmatch(payload):
        return bad(time_s, Quality.NOT_FINITE, shown)
    raise LineFault(Quality.MISMATCH, f"no number: {shown}")


def _as_float(value: float) -> float:
    """The number; inf for a whole number too large for a float."""
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _at(document: Any, pointer: Pointer) -> Any:
    """The value at a JSON Pointer (RFC 6901). Raises LineFault (MISMATCH) if there is none."""
    value = document
    for token in pointer.split("/")[1:]:
        key = token.replace("~1", "/").replace("~0", "~")
        if isinstance(value, dict) and key in value:
            value = value[key]
        elif isinstance(value, list) and re.fullmatch(r"0|[1-9][0-9]{0,8}", key) and int(key) < len(value):
            value = value[int(key)]
        else:
            raise LineFault(Quality.MISMATCH, f"nothing at {pointer} of {json.dumps(document)[:SHOWN_BYTES]}")
    return value


def _iso_time(value: Any) -> Stamp | None:
    if not isinstance(value, str):
        return None
    try:
        time = datetime.fromisoformat(value)
        if time.tzinfo is None:
            return None
        fraction = _FRACTION.search(value)
        return Stamp(time.timestamp(), 10.0 ** -len(fraction[1]) if fraction else 1.0)
    except (ValueError, OverflowError):
        return None


def _unix_time(value: Any, form: str) -> Stamp | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    unit_s = _UNITS_S[form]
    utc_s = _as_float(value) * unit_s
    # a float of s or ms has digits behind the point, down to a microsecond; a whole number has none
    return Stamp(utc_s, 1e-6 if isinstance(value, float) else unit_s)
