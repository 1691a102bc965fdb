"""A run to record: a machine whose gauges drift and fail, whose target and machine zero change."""

from __future__ import annotations

import csv
import json
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from compd.gauge import Quality
from compd.kernel_versions import kernel_versions
from compd.live.daemon import model_columns
from compd.live.loop import CyclePacker, CycleUnpacker, Directions, Target
from compd.live.record import Recorder, RecordingLimits
from compd.live.service import ReadingsMessage
from compd.live.system import THIS_COMPUTER
from compd.release import __version__
from tests.support.live_machine import RAW_AT_ZERO_MM, Machine

ROOMY = RecordingLimits(part_bytes=10**9, part_s=1e9, limit_bytes=10**10, drop_oldest=False)
_FAULTS = [Quality.TIMEOUT, Quality.CRC, Quality.LINE_LOST, Quality.OVER_RANGE]


class Run:
    """Cycles of `machine`, with the lines that the daemon would send of them."""

    def __init__(self, machine: Machine, seed: int = 1):
        self.machine = machine
        self.random = np.random.default_rng(seed)
        self.packer = CyclePacker(Directions(machine.wires.scale.wires))
        self.unpacker = CycleUnpacker()
        model = machine.settings.model
        self.transcript = ReadingsMessage(
            machine.wires, machine.latest.channels, *model_columns(model, machine.configuration)
        )
        self.version = {
            "class": "VERSION",
            "protocol": 1,
            "release": __version__,
            "machine": machine.configuration.machine,
            "config_hash": machine.configuration.config_hash,
            "links": machine.configuration.geometry.links,
            "computed_by": dict(kernel_versions()),
        }
        described = {"columns": self.transcript.columns, **self.transcript.from_setpoints}
        self.watch = {"class": "WATCH", "what": "readings", **described}

    def quiet(self, cycles):
        """Nothing but noise: (line, message, setpoint) of each cycle."""
        machine = self.machine
        for _ in range(cycles):
            for channel in machine.change_mm:
                machine.change_mm[channel] += float(self.random.normal(0, 1e-4))
            yield self.recorded(machine.step())

    def eventful(self, cycles):
        """Everything that a day may bring: lost and frozen gauges, targets, jumps, a machine zero taken anew."""
        machine, random = self.machine, self.random
        events = [self.fault, self.mend, self.freeze, self.target, self.release, self.jump, self.take_zero]
        for recorded in self.quiet(cycles):
            yield recorded
            if random.random() < 0.1:
                events[random.integers(len(events))]()
            if random.random() < 0.05:
                self.mend()
            assert machine.tick == recorded[1]["seq"]

    def recorded(self, setpoint):
        line = self.transcript.line(self.unpacker.unpack(self.packer.pack(setpoint, setpoint.to_json())))
        return line, json.loads(line), setpoint

    def any_channel(self):
        return str(self.random.choice(list(self.machine.latest.channels)))

    def fault(self):
        self.machine.faults[self.any_channel()] = _FAULTS[self.random.integers(len(_FAULTS))]

    def freeze(self):
        self.machine.frozen.add(self.any_channel())

    def mend(self):
        self.machine.faults.clear()
        self.machine.frozen.clear()
        for channel in self.machine.change_mm:
            self.machine.change_mm[channel] = float(self.random.normal(0, 0.01))

    def jump(self):
        self.machine.change_mm[str(self.random.choice(list(self.machine.change_mm)))] = 0.6

    def target(self):
        tip_mm = np.array([0.0, 0.0, -510.0 if self.machine.model.links == 3 else -580.0])
        tip_mm = tip_mm + self.random.uniform(-20, 20, 3)
        turned = self.machine.model.attitude_is_free and self.random.random() < 0.5
        rotation = tuple(self.random.uniform(-0.05, 0.05, 3).tolist()) if turned else None
        now_s, number = self.machine.now_s, self.machine.tick
        self.machine.commands.target = Target(tuple(tip_mm.tolist()), rotation, time_s=now_s, id=number)

    def release(self):
        self.machine.commands.target = None

    def take_zero(self):
        readings = {name: RAW_AT_ZERO_MM + change for name, change in self.machine.change_mm.items()}
        zero = self.machine.commands.zero
        self.machine.commands.zero = replace(zero, taken_at="later", readings_mm=readings)

    @contextmanager
    def recorder(self, name: Path, limits=ROOMY, reports=None, **watch):
        """A recorder that has written everything when the block ends."""
        texts = [] if reports is None else reports
        recorder = Recorder(name, self.version, self.watch | watch, limits, texts.append, THIS_COMPUTER)
        recorder.start()
        yield recorder
        recorder.close()


def rows_of(path):
    """The rows of a recording's file, as text by column."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))
