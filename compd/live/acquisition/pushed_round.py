"""Devices that push their readings: the line's thread waits, publishes them, and notes silence."""

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

# Interval (s) of new requests for a refused node or topic, which may exist later.
SUBSCRIBE_EVERY_S = 2.0
# Longest wait (s) before the thread checks whether it is to end.
MAX_WAIT_S = 0.1


@dataclass
class _Listener:
    """One channel that waits for messages of an address.

    received_s : monotonic time (s) of its last message or counted silence. quality : of its last reading.
    """

    gauge: PolledGauge
    driver: PushedGauge
    index: int
    address: str
    stale_after_s: float
    received_s: float = math.nan
    quality: Quality = Quality.NEVER_READ


class PushedRound:
    """The gauges of one line with pushed readings; used by its thread.

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
        self._subscribe_s = -math.inf  # time of the next request for refused addresses
        self._listeners = [
            _Listener(gauge, gauge.driver, index, address, stale_after_s[gauge.name])
            for gauge in gauges
            if isinstance(gauge.driver, PushedGauge)
            for index, address in enumerate(gauge.driver.addresses)
        ]
        self._noted: dict[str, bool] = {}  # whether the clock was wrong, by gauge

    def opened(self) -> None:
        """The line has been opened: no subscription yet, no message received."""
        self._subscribe_s = -math.inf
        now_s = self._clock.monotonic()
        for listener in self._listeners:
            listener.received_s, listener.quality = now_s, Quality.NEVER_READ

    def lost(self) -> None:
        """The line is lost; no reading waits to be published."""

    def take(self, line: PushedLine) -> None:
        """Publish the messages that have arrived or arrive soon. Raises LineFault (LINE_LOST)."""
        now_s = self._clock.monotonic()
        if now_s >= self._subscribe_s:
            line.subscribe([listener.address for listener in self._listeners])
            self._subscribe_s = now_s + SUBSCRIBE_EVERY_S
        messages = line.messages(MAX_WAIT_S)
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
                received = driver.receive(message)
                gauge.receive(received, now_s)
            except MemoryError:  # the whole process has run out of them
                raise
            except Exception as error:  # noqa: BLE001  of a driver; it must not end the line's thread
                gauge.fail(Quality.DRIVER_ERROR, gauge.driver_error(error), now_s)
                continue
            self._note_clock(gauge, received)
            for listener in listeners:
                for each in received:
                    if listener.gauge is gauge and listener.index == each.channel_index:
                        listener.received_s, listener.quality = now_s, each.reading.quality

    def _note_clock(self, gauge: PolledGauge, received: Sequence[Heard]) -> None:
        """Log once when the clock of a source goes wrong, and once when it is right again."""
        if not received or not received[-1].reading.ok:
            return
        note = received[-1].note
        if bool(note) != self._noted.get(gauge.name, False):
            self._noted[gauge.name] = bool(note)
            log_change = log.warning if note else log.info
            log_change("clock of a source", gauge=gauge.name, detail=note or "agrees with this computer's again")

    def _note_silence(self) -> None:
        now_s = self._clock.monotonic()
        for listener in self._listeners:
            if now_s - listener.received_s <= listener.stale_after_s:
                continue
            listener.received_s = now_s
            if listener.quality in (Quality.OK, Quality.NEVER_READ, Quality.TIMEOUT):
                hint = listener.driver.silence_hint
                text = f"nothing new on {listener.address} for {listener.stale_after_s:g} s{'; ' if hint else ''}{hint}"
                listener.gauge.receive([Heard(listener.index, bad(now_s, Quality.TIMEOUT, text))], now_s)
                listener.quality = Quality.TIMEOUT
