"""From the readings of a snapshot to the machine's quantities: which gauge, which sign, minus machine zero."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration
from compd.configuration.crosscheck import resolve_channel
from compd.configuration.operation import FRAME_DISTANCES, FrameWire
from compd.gauge import Quality, Reading
from compd.live.loop.machine_zero import MachineZero
from compd.readings import Latest, Snapshot


class WiredValues(NamedTuple):
    """Length gauges of one kind: changes since machine zero.

    change_mm : (k); nan where the reading is not good. oldest_s : monotonic time of the oldest reading.
    lost : "" when every reading is good, otherwise which is not and why.
    """

    change_mm: FloatArray
    oldest_s: float
    lost: str


class Wire(NamedTuple):
    """One channel's place in the machine: "joints.4", what it is for a person, its slot, sign and age limit."""

    channel: str
    meaning: str
    slot: int
    sign: int
    stale_after_s: float


class Wires:
    """The wires of one kind, in the machine's order."""

    def __init__(self, wires: Sequence[Wire]) -> None:
        self.wires = tuple(wires)
        self._watch = tuple((wire.slot, wire.stale_after_s) for wire in wires)
        self._sign = np.array([wire.sign for wire in wires], dtype=float)

    def zero_vector(self, zero: MachineZero) -> FloatArray:
        """Raw readings at machine zero (k), mm."""
        return np.array([zero.readings_mm[wire.channel] for wire in self.wires])

    def read(self, snapshot: Snapshot, zero_mm: FloatArray) -> WiredValues:
        """Changes since machine zero; `zero_mm` (k) from `zero_vector`."""
        now_s, readings = snapshot
        used = [readings[slot] for slot, _ in self._watch]
        change_mm = (np.array([reading[0] for reading in used]) - zero_mm) * self._sign
        oldest_s = min([reading[1] for reading in used], default=math.inf)
        lost = self.lost(snapshot)
        if lost:
            bad = [i for i, wire in enumerate(self.wires) if _fault(wire, readings[wire.slot], now_s)]
            change_mm[bad] = math.nan
        return WiredValues(change_mm, oldest_s, lost)

    def lost(self, snapshot: Snapshot) -> str:
        """ "" when every reading is good and young enough; otherwise which are not, and why."""
        now_s, readings = snapshot
        for slot, stale_after_s in self._watch:
            _, time_s, quality, _ = readings[slot]
            if quality is not Quality.OK or now_s - time_s > stale_after_s:
                faults = (_fault(wire, readings[wire.slot], now_s) for wire in self.wires)
                return ", ".join(fault for fault in faults if fault)
        return ""


def _fault(wire: Wire, reading: Reading, now_s: float) -> str:
    """ "joint 4 (joints.4): timeout", or "" for a reading that can be used."""
    name = f"{wire.meaning} ({wire.channel})"
    if reading.quality is not Quality.OK:
        return f"{name}: {reading.quality}" + (f" ({reading.detail})" if reading.detail else "")
    age_s = now_s - reading.time_s
    if age_s > wire.stale_after_s:
        return f"{name}: {Quality.STALE} ({age_s:.2f} s old, allowed {wire.stale_after_s:g} s)"
    return ""


class MachineWires:
    """The whole wiring of one configuration.

    scale : in the order of links. comparators : first the `joints` joint comparators, then t1..t3, u1..u6.
    """

    def __init__(self, configuration: Configuration, latest: Latest) -> None:
        wiring = configuration.wiring

        def wire(reference: str, meaning: str, sign: int = 1) -> Wire:
            channel = resolve_channel(reference, configuration.gauges, configuration.drivers)
            assert channel is not None, f"{reference} was checked when the configuration was loaded"
            own = configuration.gauges[channel.split(".")[0]].stale_after_s
            stale_after_s = own if own is not None else configuration.loop.stale_after_s
            return Wire(channel, meaning, latest.index[channel], sign, stale_after_s)

        frame: dict[str, FrameWire] = {entry.distance: entry for entry in wiring.frame}
        scale = sorted(wiring.scale, key=lambda entry: entry.link)
        self.scale = Wires([wire(w.gauge, f"scale {w.link}", w.sign) for w in scale])
        self.comparators = Wires(
            [
                *(wire(w.gauge, f"joint {k}", w.sign) for k, w in enumerate(wiring.joint, start=1)),
                *(wire(frame[d].gauge, f"frame {d}", frame[d].sign) for d in FRAME_DISTANCES),
            ]
        )
        self.joints = len(wiring.joint)
        self.tool_on_plate = configuration.geometry.tool.on == "plate"
        self._quantities = {q.name: wire(q.gauge, q.name) for q in wiring.quantities}

    @property
    def length_channels(self) -> tuple[str, ...]:
        """Every channel that machine zero needs."""
        return tuple(wire.channel for wire in self.length_wires)

    @property
    def length_wires(self) -> tuple[Wire, ...]:
        """Scales, joint and frame comparators."""
        return (*self.scale.wires, *self.comparators.wires)

    @property
    def all_wires(self) -> tuple[Wire, ...]:
        """Length gauges, then quantities."""
        return (*self.length_wires, *self._quantities.values())

    def lost(self, snapshot: Snapshot) -> str:
        """ "" when every length gauge can be used; otherwise which cannot, and why."""
        return ", ".join(filter(None, (self.scale.lost(snapshot), self.comparators.lost(snapshot))))

    @property
    def quantity_names(self) -> tuple[str, ...]:
        """Temperatures, forces and the rest."""
        return tuple(self._quantities)

    def quantity_wires(self, names: Sequence[str]) -> Wires:
        """The wires of some quantities, in this order. They have no zero. Raises KeyError for one not wired."""
        return Wires([self._quantities[name] for name in names])
