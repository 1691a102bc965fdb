"""A device that publishes on MQTT topics: plain numbers, or a document with the values described for its gauge."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from compd.twins import Sense, SimulatedPushedDevice
from compd_drivers.simulated.shared import number_for

PER_SECOND = {"unix_s": 1.0, "unix_ms": 1e3, "unix_us": 1e6, "unix_ns": 1e9}


class SimulatedPublisher(SimulatedPushedDevice):
    """Publishes every channel; one whose sensor is off is null, or the word `off`."""

    def __init__(self, options: Any, sense: Sense) -> None:
        super().__init__(options, sense)
        # it must publish at least once in a period
        self.period_s = None if options.period_s is None else options.period_s / 2

    def say(self, utc_s: float) -> Mapping[str, Any]:
        documents: dict[str, Any] = {}
        for channel in self.options.channels:
            value = self.sense(channel.name)
            number = number_for(channel, value) / channel.scale if math.isfinite(value) else None
            if not channel.value and channel.time is None and channel.status is None:
                documents[channel.topic] = "off" if number is None else number
                continue
            document = documents.setdefault(channel.topic, {})
            _put(document, channel.value, number)
            if channel.time is not None:
                _put(document, channel.time, _time(channel.time_format, utc_s))
            if channel.status is not None:
                _put(document, channel.status.at, channel.status.ok[0])
        return {topic: json.dumps(document).encode() for topic, document in documents.items()}


def _time(form: str, utc_s: float) -> Any:
    if form == "iso8601":
        return datetime.fromtimestamp(utc_s, UTC).isoformat(timespec="microseconds")
    return utc_s * PER_SECOND[form]


def _put(document: Any, pointer: str, value: Any) -> None:
    """Put a value where a JSON Pointer shows; digits make lists, all else objects."""
    *path, last = [token.replace("~1", "/").replace("~0", "~") for token in pointer.split("/")[1:]]
    place = document
    for token, after in zip(path, [*path, last][1:], strict=True):
        if _get(place, token) is None:
            _set(place, token, [] if after.isdigit() else {})
        place = _get(place, token)
    _set(place, last, value)


def _get(place: Any, token: str) -> Any:
    """The item at `token`; None if there is none."""
    if isinstance(place, list):
        return place[int(token)] if int(token) < len(place) else None
    return place.get(token)


def _set(place: Any, token: str, value: Any) -> None:
    if isinstance(place, list):
        place += [None] * (int(token) + 1 - len(place))
        place[int(token)] = value
    else:
        place[token] = value
