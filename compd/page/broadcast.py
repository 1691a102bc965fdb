"""Events for all browsers: live ones twenty times a second, slow ones once a second, each made once."""

from __future__ import annotations

import asyncio
import time
import zlib
from bisect import bisect_left
from collections import deque
from collections.abc import AsyncIterator, Mapping
from itertools import islice
from typing import Any

import orjson

from compd.gauge import Quality
from compd.page.browsers import Browser, Browsers
from compd.page.cadence import Cadence
from compd.page.daemon_link import DaemonLink
from compd.page.history import COARSE_HZ, COARSE_S, FINE_HZ, FINE_S, History, Traces
from compd.page.model_effects import ModelEffects
from compd.page.recordings import Recordings
from compd.page.scene import scene
from compd.page.shown_texts import shown

# The fastest level: a third of the bytes in a tenth of a millisecond.
_LEVEL = 1


class _Kept:
    """The newest events, one every `1 / rate_hz` seconds, deflated."""

    def __init__(self, span_s: float, rate_hz: float) -> None:
        self.cadence = Cadence(rate_hz)
        self.times_s: deque[float] = deque(maxlen=round(span_s * rate_hz))
        self.events: deque[bytes] = deque(maxlen=round(span_s * rate_hz))

    def note(self, time_s: float, event: bytes) -> None:
        self.cadence.kept(time_s)
        self.times_s.append(time_s)
        self.events.append(event)

    def nearest(self, time_s: float) -> tuple[float, bytes] | None:
        if not self.times_s:
            return None
        after = min(bisect_left(self.times_s, time_s), len(self.times_s) - 1)
        place = min((max(after - 1, 0), after), key=lambda k: abs(self.times_s[k] - time_s))
        return self.times_s[place], next(islice(self.events, place, None))


class Moments:
    """History of live events as they were sent: ten a second for the last minute, one a second for the hour.

    The tables of the history are for charts. Here is the rest of a cycle, which a page that is frozen or scrubbed
    shows: the machine's pose, what the corrections and the tip are made of, the shadow, every gauge. STATUS (timing of
    the loop, clients) is not kept.

    Events of the last hour by time; used by the event loop's thread alone.
    """

    def __init__(self) -> None:
        self._kept = (_Kept(FINE_S, FINE_HZ), _Kept(COARSE_S, COARSE_HZ))

    def note(self, time_s: float, event: bytes) -> None:
        """Keep the event (JSON) of `time_s` (Unix, s) if one is due."""
        due = [kept for kept in self._kept if kept.cadence.is_due(time_s)]
        if due:
            deflated = zlib.compress(event, _LEVEL)
            for kept in due:
                kept.note(time_s, deflated)

    def nearest(self, time_s: float) -> bytes | None:
        """The stored event nearest to `time_s`; None before the first."""
        moments = [moment for moment in (kept.nearest(time_s) for kept in self._kept) if moment is not None]
        return zlib.decompress(min(moments, key=lambda moment: abs(moment[0] - time_s))[1]) if moments else None


Message = Mapping[str, Any]

HOUR_S = 3600.0
# Interval (s) of stored counts, and thus the accuracy of the hour.
KEPT_EVERY_S = 60.0


def of_links(setpoint: Message) -> Message:
    """The setpoint as the strips of the links show it: causes of a correction of the tip are in the budget alone."""
    if "tip_correction_mm" not in setpoint:
        return setpoint
    return {**setpoint, "correction_mm": setpoint.get("correction_mm", []), "sources_mm": {}}


class FaultCounts:
    """Counts of one daemon since the page has seen them; reset when a count falls, which shows a new start."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, dict[str, int]]] = deque(maxlen=round(HOUR_S / KEPT_EVERY_S) + 1)
        self._newest: dict[str, int] = {}

    def note(self, time_s: float, status: Message) -> None:
        """Take the counts of a STATUS received at `time_s` (Unix, s)."""
        lines = status["lines"].values()
        counts = {name: sum(gauge["faults"].values()) for line in lines for name, gauge in line["gauges"].items()}
        if any(counts.get(name, 0) < count for name, count in self._newest.items()):
            self._kept.clear()
        if not self._kept or time_s >= self._kept[-1][0] + KEPT_EVERY_S:
            self._kept.append((time_s, counts))
        self._newest = counts

    def summary(self) -> dict[str, Any] | None:
        """None before the first STATUS.

        `since_s` : from when `recent` counts, Unix time, s.  `hour` : whether that is an hour; before, the page has not
        seen one.  `total` : of each gauge, since the daemon's start.  `recent` : of those, since `since_s`.
        """
        if not self._kept:
            return None
        since_s, before = self._kept[0]
        recent = {name: count - before.get(name, 0) for name, count in self._newest.items()}
        whole = len(self._kept) == self._kept.maxlen
        return {"since_s": since_s, "hour": whole, "total": self._newest, "recent": recent}


LIVE_HZ = 20.0
SLOW_EVERY_S = 1.0

Event = Mapping[str, Any]


class Broadcast:
    """The events; used by the event loop's thread alone."""

    def __init__(self, link: DaemonLink, browsers: Browsers, recordings: Recordings) -> None:
        self._link = link
        self._browsers = browsers
        self._recordings = recordings
        self.history: History | None = None  #: of the machine; None before the daemon has told what machine it is
        self.moments = Moments()  #: moments, traces: the live events of that machine, and what its gauges showed
        self.traces = Traces(0)
        self._faults = FaultCounts()
        self._model_effects = ModelEffects()
        self._machine: Any = None
        self._live = self._slow = b""
        self._slow_count = 0
        self._new_events = asyncio.Condition()
        self._ended = False

    async def run(self) -> None:
        """Make events until cancelled."""
        loop = asyncio.get_running_loop()
        due_s = slow_due_s = loop.time()
        while True:
            slow = due_s >= slow_due_s
            if slow:
                slow_due_s = max(slow_due_s + SLOW_EVERY_S, due_s)
            await self.make(time.time(), slow)
            due_s = max(due_s + 1 / LIVE_HZ, loop.time())
            await asyncio.sleep(due_s - loop.time())

    async def make(self, unix_s: float, slow: bool) -> None:
        """The events at `unix_s` (s); includes the slow one if it is due."""
        self._note_machine()
        self._model_effects.note(self._link.budget, self._link.models)
        live = self._live_event(unix_s)
        data = plain(live)
        if self.history is not None:
            readings = self._link.readings
            self.history.note(unix_s, None if readings is None else readings["setpoint"], self._link.budget)
            self.moments.note(unix_s, data)
            self.traces.note(unix_s, live.get("gauges", ()))
        async with self._new_events:
            self._live = encoded("live", data)
            if slow:
                self._slow = encoded("slow", plain(self._slow_event()))
                self._slow_count += 1
            self._new_events.notify_all()

    def end(self) -> None:
        """End every browser's events within a tick, so that the server can stop; called from a signal's handler too."""
        self._ended = True

    async def events(self, browser: Browser) -> AsyncIterator[bytes]:
        """The events of one browser until it disconnects. Each is the newest; a slow browser gets fewer."""
        try:
            hello = {"id": browser.id, "role": browser.token.role, "machine": self._machine}
            yield encoded("hello", plain(hello))
            machine, slow_count = self._machine, -1
            while not self._ended:
                async with self._new_events:
                    await self._new_events.wait()
                if self._machine is not machine:
                    machine = self._machine
                    yield encoded("machine", plain({"machine": machine}))
                if self._slow_count != slow_count:
                    slow_count = self._slow_count
                    yield self._slow
                yield self._live
        finally:
            self._browsers.disconnect(browser)

    def _note_machine(self) -> None:
        machine = self._link.machine
        if machine is None or machine == self._machine:
            return
        self._machine = machine
        self.history = History(sum(wire["kind"] == "scale" for wire in machine["wiring"]))
        self.moments = Moments()
        self.traces = Traces(len(machine["wiring"]))
        self._faults = FaultCounts()

    def _live_event(self, unix_s: float) -> Event:
        """The newest values of everything that moves. `made`: monotonic time (s), which shows the event's delay.

        unix_s : now, s.
        """
        link = self._link
        event: dict[str, Any] = {"made": time.monotonic(), "unix_s": unix_s}
        event |= {"connected": link.connected, "reason": link.reason}
        if link.connected and link.readings is not None and self._machine is not None:
            setpoint = link.readings["setpoint"]
            event["setpoint"] = of_links(setpoint)
            event["gauges"] = gauges(link.readings, link.columns, link.status)
            event["budget"] = (link.budget or {}).get("tip_um")
            event["shadow_budget"] = (link.budget or {}).get("shadow_tip_um")
            event["scene"] = scene(self._machine, setpoint, link.budget)
        return event

    def _slow_event(self) -> Event:
        """Status, models and their effects, counts of faults, browsers and the running recording."""
        if self._link.status is not None:
            self._faults.note(time.time(), self._link.status)
        running = self._recordings.running
        return {
            "status": self._link.status,
            "models": self._link.models,
            "model_effects": self._model_effects.summary(),
            "faults": self._faults.summary(),
            "browsers": self._browsers.summary(),
            "recording": None if running is None else {"name": running.name, "started": running.started_s},
            "last_words": self._recordings.last_words,
        }


def gauges(readings: Event, columns: list[dict[str, Any]], status: Event | None = None) -> list[dict[str, Any]]:
    """Values of each wired channel in the cycle of a READINGS message, in the order of MACHINE's wiring.

    `value` : a length in mm since machine zero, or another quantity in its unit; absent where there is none, or no
    machine zero to count from.  `age_s` : of a value.  `fault` : why there is none, or why it must not be used.
    `warning` : what the newest STATUS says that is to be looked at.  `needs_person` : as it says.
    """
    said = () if status is None else status["gauges"]
    keys = ("warning", "needs_person")
    told = {channel["channel"]: {key: channel[key] for key in keys if key in channel} for channel in said}
    zero = readings.get("zero", {}).get("readings_mm", {})
    gauges: list[dict[str, Any]] = []
    for column in columns:
        reading = readings["readings"][column["channel"]]
        gauge: dict[str, Any] = {}
        if "value" in reading:
            value, age_s = reading["value"], readings["time_s"] - reading["time_s"]
            gauge["age_s"] = round(age_s, 4)
            if age_s > column["stale_after_s"]:
                gauge["fault"] = Quality.STALE
            if "sign" not in column:
                gauge["value"] = value
            elif column["channel"] in zero:
                gauge["value"] = round(column["sign"] * (value - zero[column["channel"]]), 7)
        else:
            gauge["fault"] = reading["quality"]
            if "detail" in reading:
                gauge["detail"] = reading["detail"]
        gauges.append(gauge | told.get(column["channel"], {}))
    return gauges


def plain(event: Event) -> bytes:
    """An event as JSON, `shown`."""
    return orjson.dumps(shown(event))


def encoded(name: str, data: bytes) -> bytes:
    """An encoded event (server-sent events, WHATWG HTML, section 9.2); `data`: one line."""
    return b"event: " + name.encode() + b"\ndata: " + data + b"\n\n"
