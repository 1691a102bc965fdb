"""The STATUS message: machine zero, models, the loop and its timing, sockets, lines and every gauge."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from compd.clock import Clock
from compd.errors import StateError
from compd.gauge import Quality
from compd.live.loop import AdoptedModels, Commands, Histogram, LoopTiming, skew_of
from compd.live.machine import MachineWires, waiting_text
from compd.live.memory import Control, Latest, TrustMemory
from compd.live.service.message_keys.status import StatusKeys
from compd.live.service.publisher import Publisher
from compd.live.service.udp_sender import UdpSender
from compd.live.system import changed_ports
from compd.units import UM_PER_MM


@dataclass(frozen=True, kw_only=True)
class StatusReport:
    """Collects the STATUS message from the daemon's parts, of which it changes none; on the publisher's thread."""

    version: Mapping[str, Any]  #: the VERSION message, whose keys STATUS repeats
    latest: Latest  #: latest, wires, commands, adopted, timing, control, publisher: the daemon's own
    wires: MachineWires
    commands: Commands
    adopted: AdoptedModels
    timing: LoopTiming
    control: Control
    publisher: Publisher
    packets: UdpSender | None  #: the UDP sender, where one is configured
    lines: Callable[[], Mapping[str, Any]]  #: makes the state of every line, by name
    trust: TrustMemory  #: what is known of the length channels
    clock: Clock
    ports: Mapping[str, str]  #: the lasting name of each gauge's port
    own_time: Histogram | None = None  #: how long own kinematics takes; None for machines that compd knows

    def message(self) -> dict[str, Any]:
        """The message as plain data; what is unknown is left out."""
        now_s = self.clock.monotonic()
        published, gauges = self.publisher.summary(), self._gauges(now_s)
        not_believed = [gauge["channel"] for gauge in gauges if gauge["quality"] is Quality.DISTRUSTED]
        if self.packets is not None:
            published |= self.packets.summary()
        return StatusKeys.message(
            **{key: part for key, part in self.version.items() if key != "class"},
            time_s=round(now_s, 6),
            mode="cmm" if self.commands.target is None else "machine_tool",
            zero=self._zero(),
            model=self._model(),
            loop=self._loop(),
            realtime=self.control.realtime.read() or {},
            processes=self.control.processes.read() or {},
            publisher=published,
            skew_s=self._skew_s(now_s),
            lines=self.lines(),
            gauges=gauges,
            waits_for_person=waiting_text(not_believed) or None,
        )

    def _loop(self) -> dict[str, Any]:
        summary = self.timing.summary()
        own = {} if self.own_time is None else self.own_time.summary()
        return summary | {f"own_kinematics_{name}": value for name, value in own.items()}

    def _zero(self) -> dict[str, Any]:
        zero = self.commands.zero
        if isinstance(zero, StateError):
            return {"taken": False, "reason": str(zero)}
        changed = changed_ports(zero.ports, self.ports)
        return {"taken": True, "taken_at": zero.taken_at, "ports_changed": changed or None}

    def _model(self) -> dict[str, Any]:
        """The applied model and, if there is one, the shadow; without their paths, which no remote client needs."""
        return {
            name: {key: part for key, part in model.items() if key != "file"}
            for name, model in self.adopted.summary.items()
        }

    def _skew_s(self, now_s: float) -> float:
        """Between the oldest and the newest length that is good now; nan without any."""
        readings = self.latest.snapshot(now_s).readings
        wired = [(readings[wire.slot], wire.stale_after_s) for wire in self.wires.length_wires]
        return round(skew_of(r for r, stale_after_s in wired if r.ok and now_s - r.time_s <= stale_after_s), 6)

    def _gauges(self, now_s: float) -> list[dict[str, Any]]:
        """Every channel: its raw value, before sign and machine zero, and its age (s); None for what is unknown."""
        gauges: list[dict[str, Any]] = []
        stale_after_s = {wire.channel: wire.stale_after_s for wire in self.wires.all_wires}
        meanings = {wire.channel: wire.meaning for wire in self.wires.all_wires}
        warnings = self.trust.warnings.read() or {}
        noises = {wire.channel: wire.noise for wire in self.wires.length_wires}
        for channel, reading in zip(self.latest.channels, self.latest.snapshot(now_s).readings, strict=True):
            age_s = now_s - reading.time_s
            stale = reading.ok and age_s > stale_after_s.get(channel, math.inf)
            noise, motion, slot = noises.get(channel), reading.motion, self.trust.index.get(channel)
            gauges.append(
                {
                    "channel": channel,
                    "quality": Quality.STALE if stale else reading.quality,
                    "measures": meanings.get(channel),
                    "noise_um": noise and noise.um,
                    "noise_from": (noise and noise.source) or None,
                    "age_s": None if reading.quality is Quality.NEVER_READ else round(age_s, 4),
                    "value": round(reading.value, 7) if reading.ok and not stale else None,
                    "detail": reading.detail or None,
                    "scatter_um": motion and round(motion.scatter_mm * UM_PER_MM, 4),
                    "warning": warnings.get(channel),
                    "needs_person": (slot is not None and self.trust.needs_person(slot)) or None,
                }
            )
        return gauges
