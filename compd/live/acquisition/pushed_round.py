"""A line's thread and devices that speak by themselves: it waits, publishes what comes, and notes silence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import structlog

from compd.clock import Clock
from compd.gauge import Quality, bad
from compd.live.acquisition.polled_gauge import BackOff, PolledGauge
from compd.pushed_gauge import Heard, Message, PushedGauge, PushedLine

log = structlog.get_logger()

# A node or topic that was refused may be there later: it is asked for again after so long, s.
SUBSCRIBE_EVERY_S = 2.0
# The thread looks so often, s, whether it is to end.
LONGEST_WAIT_S = 0.1


@dataclass
class _Listener:
    """One channel that wants an address.

    heard_s : when it was heard last, or its silence counted, monotonic, s. quality : of what it read last.
    """

    gauge: PolledGauge
    driver: PushedGauge
    place: int
    address: str
    stale_after_s: float
    heard_s: float = math.nan
    quality: Quality = Quality.NEVER_READ


class PushedRound:
    """The gauges of one line that speaks by itself; used by its thread.

    Silence: where a value has been followed by nothing for `stale_after_s`, the channel has a timeout. A device that
    said that it has no value has not to repeat it.

    Attributes
    ----------
    duration_s : nan, since nothing is asked.
    """

    duration_s = math.nan

    def __init__(
        self, gauges: Sequence[PolledGauge], stale_after_s: Mapping[str, float], clock: Clock, back_off: BackOff
    ) -> None:
        """`stale_after_s`: by gauge, age (s) from which its readings are not used. `back_off`: of the line, which any
        message ends."""
        self._clock = clock
        self._back_off = back_off
        self._subscribe_s = -math.inf  # when what was refused is asked for again
        self._listeners = [
            _Listener(gauge, gauge.driver, index, address, stale_after_s[gauge.name])
            for gauge in gauges
            if isinstance(gauge.driver, PushedGauge)
            for index, address in enumerate(gauge.driver.addresses)
        ]
        self._noted: dict[str, bool] = {}  # by gauge: whether its clock was wrong

    def opened(self) -> None:
        """The line has been opened: nothing is subscribed to, and nothing was heard on it."""
        self._subscribe_s = -math.inf
        now_s = self._clock.monotonic()
        for listener in self._listeners:
            listener.heard_s, listener.quality = now_s, Quality.NEVER_READ

    def lost(self) -> None:
        """The line is lost; nothing waits to be published."""

    def take(self, line: PushedLine) -> None:
        """Publish what has come, or comes soon. Raises LineFault (LINE_LOST)."""
        now_s = self._clock.monotonic()
        if now_s >= self._subscribe_s:
            line.subscribe([listener.address for listener in self._listeners])
            self._subscribe_s = now_s + SUBSCRIBE_EVERY_S
        messages = line.messages(LONGEST_WAIT_S)
        for message in messages:
            self._publish(message)
        self._note_silence()
        if messages:
            self._back_off.succeeded()

    def _publish(self, message: Message) -> None:
        listeners = [listener for listener in self._listeners if listener.address == message.address]
        for gauge, driver in {id(each.gauge): (each.gauge, each.driver) for each in listeners}.values():
            now_s = self._clock.monotonic()
            try:
                heard = driver.hear(message)
                gauge.hear(heard, now_s)
            except MemoryError:  # it is the whole process that has none left
                raise
            except Exception as error:  # noqa: BLE001  of a driver; it must not end the line's thread
                gauge.fail(Quality.DRIVER_ERROR, gauge.driver_error(error), now_s)
                continue
            self._note_clock(gauge, heard)
            for listener in listeners:
                for each in heard:
                    if listener.gauge is gauge and listener.place == each.place:
                        listener.heard_s, listener.quality = now_s, each.reading.quality

    def _note_clock(self, gauge: PolledGauge, heard: Sequence[Heard]) -> None:
        """Log once that the clock of a source is wrong, and once that it is right again."""
        if not heard or not heard[-1].reading.ok:
            return
        note = heard[-1].note
        if bool(note) != self._noted.get(gauge.name, False):
            self._noted[gauge.name] = bool(note)
            log_change = log.warning if note else log.info
            log_change("clock of a source", gauge=gauge.name, detail=note or "agrees with this computer's again")

    def _note_silence(self) -> None:
        now_s = self._clock.monotonic()
        for listener in self._listeners:
            if now_s - listener.heard_s <= listener.stale_after_s:
                continue
            listener.heard_s = now_s
            if listener.quality in (Quality.OK, Quality.NEVER_READ, Quality.TIMEOUT):
                hint = listener.driver.silence_hint
                text = f"nothing new on {listener.address} for {listener.stale_after_s:g} s{'; ' if hint else ''}{hint}"
                listener.gauge.hear([Heard(listener.place, bad(now_s, Quality.TIMEOUT, text))], now_s)
                listener.quality = Quality.TIMEOUT
