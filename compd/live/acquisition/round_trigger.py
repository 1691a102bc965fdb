"""The round trigger: one message latches all gauges of a line, so that they are measured at the same time.

It is sent once before the gauges of a round are read, and every reading of that round has its time, even if a gauge is
missing. The devices latch no earlier than its last bit has left, and do not confirm it. The readings are published
together at the end of the round: a snapshot of two mixed rounds would be further apart than without a trigger.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from compd.gauge import Gauge, Reading
from compd.line_settings import TriggerBytes, TriggerWrite
from compd.live.memory import Latest


def send_trigger(trigger: TriggerBytes | TriggerWrite, line: Any) -> float:
    """Latch all gauges of a line, and wait until they have settled.

    line : a stream of bytes, or a Modbus master.
    Returns the monotonic time (s) at which the trigger's last bit had left. Raises LineFault as the line does.
    """
    if isinstance(trigger, TriggerWrite):
        return float(
            line.write(trigger.unit, trigger.function, trigger.address, trigger.values, trigger.settle_s or 0.0)
        )
    sent_s = float(line.send(trigger.request))
    line.rest_until(sent_s + trigger.settle_s)
    return sent_s


def stamped(readings: Sequence[Reading], latched_s: float | None) -> Sequence[Reading]:
    """The readings with the time (s) of the trigger that latched them; unchanged without a trigger (None)."""
    if latched_s is None:
        return readings
    return [reading._replace(time_s=latched_s) for reading in readings]


def read_latched(gauge: Gauge[Any], line: Any, trigger: TriggerBytes | TriggerWrite | None) -> Sequence[Reading]:
    """One poll of a single gauge, after its line's trigger if it has one. Raises LineFault."""
    latched_s = None if trigger is None else send_trigger(trigger, line)
    return stamped(gauge.read(line), latched_s)


class RoundBuffer:
    """Stands for `Latest` on a line with a round trigger: keeps the readings until `publish`."""

    def __init__(self, latest: Latest) -> None:
        self.index: Mapping[str, int] = latest.index
        self._latest = latest
        self._readings: dict[int, Reading] = {}

    def put(self, index: int, reading: Reading) -> None:
        """The reading of the channel at `index`."""
        self._readings[index] = reading

    def publish(self) -> None:
        """Publish the kept readings at once."""
        readings, self._readings = self._readings, {}
        if readings:
            self._latest.put_all(readings)
