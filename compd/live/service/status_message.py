"""The STATUS message: how the whole daemon is doing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from compd.clock import Clock
from compd.configuration import Configuration
from compd.errors import StateError
from compd.gauge import Quality
from compd.json_text import omit_unknown
from compd.live.loop.commands import Commands
from compd.live.loop.loop import Loop
from compd.live.loop.wiring import MachineWires
from compd.live.service.publisher import Publisher
from compd.live.service.udp_sender import UdpSender
from compd.readings import Latest


@dataclass(frozen=True)
class StatusReport:
    """Looks at everything and changes nothing; called on the publisher's thread."""

    version: Mapping[str, Any]
    configuration: Configuration
    latest: Latest
    wires: MachineWires
    commands: Commands
    loop: Loop
    publisher: Publisher
    packets: UdpSender | None
    lines: Callable[[], Mapping[str, Any]]
    clock: Clock

    def message(self) -> dict[str, Any]:
        """What is unknown is left out."""
        now_s = self.clock.monotonic()
        published = self.publisher.summary()
        if self.packets is not None:
            published |= self.packets.summary()
        message = {
            **self.version,
            "class": "STATUS",
            "time_s": round(now_s, 6),
            "mode": "cmm" if self.commands.target is None else "machine_tool",
            "zero": self._zero(),
            "model": self._model(),
            "loop": self.loop.timing.summary(),
            "realtime": {name: granted._asdict() for name, granted in self.loop.permissions.items()},
            "publisher": published,
            "lines": self.lines(),
            "gauges": self._gauges(now_s),
        }
        known: dict[str, Any] = omit_unknown(message)
        return known

    def _zero(self) -> dict[str, Any]:
        zero = self.commands.zero
        if isinstance(zero, StateError):
            return {"taken": False, "reason": str(zero)}
        return {"taken": True, "taken_at": zero.taken_at}

    def _model(self) -> dict[str, Any]:
        """Applied, and shadow if there is one; without their files, which are this computer's business."""
        summary = {} if self.commands.models is None else self.commands.models.summary
        return {name: {key: part for key, part in model.items() if key != "file"} for name, model in summary.items()}

    def _gauges(self, now_s: float) -> list[dict[str, Any]]:
        """Every channel: raw value, before sign and zero, with its age; a stale one says so."""
        found: list[dict[str, Any]] = []
        stale_after_s = {wire.channel: wire.stale_after_s for wire in self.wires.all_wires}
        meanings = {wire.channel: wire.meaning for wire in self.wires.all_wires}
        for channel, reading in zip(self.latest.channels, self.latest.snapshot(now_s).readings, strict=True):
            age_s = now_s - reading.time_s
            old = reading.ok and age_s > stale_after_s.get(channel, math.inf)
            entry: dict[str, Any] = {"channel": channel, "quality": Quality.STALE if old else reading.quality}
            if channel in meanings:
                entry["measures"] = meanings[channel]
            if reading.quality is not Quality.NEVER_READ:
                entry["age_s"] = round(age_s, 4)
            if reading.ok and not old:
                entry["value"] = round(reading.value, 7)
            if reading.detail:
                entry["detail"] = reading.detail
            found.append(entry)
        return found
