"""The wiring: which channel measures what, and the signed values since machine zero in a snapshot of readings."""

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
from compd.live.loop.reasons import GaugeFault, Lost, lost
from compd.live.loop.wired_readings import age_uncertainties_mm, drifts_mm_per_s, read_values
from compd.live.memory.latest import Latest, Snapshot

ALL_GOOD = Lost()


class WiredValues(NamedTuple):
    """The values of k wires in one snapshot.

    values : (k), sign * (reading - zero) in the unit of each wire: mm since machine zero for lengths, the gauge's own
        for temperatures and other quantities, whose zero is 0. nan where the reading cannot be used.
    oldest_s, newest_s : monotonic times of the oldest and of the newest reading; inf and -inf without wires.
    lost : which readings cannot be used, and why.
    beyond : which values were beyond the range that they are limited to; "" for none.
    """

    values: FloatArray
    oldest_s: float
    newest_s: float
    lost: Lost
    beyond: str = ""


class Wire(NamedTuple):
    """What one channel measures.

    channel : "gauge.channel". meaning : for people, as "joint 4". slot : its index in a snapshot. sign : +1 or -1.
    stale_after_s : age from which a reading must not be used.
    """

    channel: str
    meaning: str
    slot: int
    sign: int
    stale_after_s: float


class Wires:
    """The wires of one kind (scales, comparators or quantities), in the order of the machine's numbering."""

    def __init__(self, wires: Sequence[Wire]) -> None:
        self.wires = tuple(wires)
        self._wired = np.array([wire.slot for wire in wires], dtype=np.int64)
        self._stale_after_s = np.array([wire.stale_after_s for wire in wires], dtype=float)
        self._sign = np.array([wire.sign for wire in wires], dtype=float)

    def zero_vector(self, zero: MachineZero) -> FloatArray:
        """(k,) raw readings (mm) at machine zero."""
        return np.array([zero.readings_mm[wire.channel] for wire in self.wires])

    def read(self, snapshot: Snapshot, zero: FloatArray, extrapolate: bool = False) -> WiredValues:
        """The values in a snapshot; `zero` (k) from `zero_vector`, or zeros for quantities.

        extrapolate : carry each reading on to the snapshot's time.
        """
        now_s, readings = snapshot
        values = np.empty(len(self.wires))
        oldest_s, newest_s, usable = read_values(
            readings.slots, self._wired, self._stale_after_s, self._sign, zero, now_s, extrapolate, values
        )
        if usable:
            return WiredValues(values, oldest_s, newest_s, ALL_GOOD)
        faults = [_fault(wire, readings[wire.slot], now_s) for wire in self.wires]
        values[[fault is not None for fault in faults]] = math.nan
        return WiredValues(values, oldest_s, newest_s, lost(fault for fault in faults if fault is not None))

    def drift_mm_per_s(self, snapshot: Snapshot) -> tuple[float, ...]:
        """(k) how fast each length may move while it is held, mm/s."""
        drifts = np.empty(len(self.wires))
        drifts_mm_per_s(snapshot.readings.slots, self._wired, drifts)
        return tuple(drifts.tolist())

    def age_uncertainty_mm(self, snapshot: Snapshot, extrapolate: bool) -> FloatArray:
        """(k) standard uncertainty of each length by its age, mm.

        0 for one that is not good; nan where it is not known how it moves.
        """
        uncertainties_mm = np.empty(len(self.wires))
        age_uncertainties_mm(snapshot.readings.slots, self._wired, snapshot.time_s, extrapolate, uncertainties_mm)
        return uncertainties_mm

    def lost(self, snapshot: Snapshot) -> Lost:
        """Which readings are not good or too old, and why."""
        return self.read(snapshot, np.zeros(len(self.wires))).lost

    def part(self, start: int, end: int) -> Wires:
        """The wires from index `start` to `end`."""
        return Wires(self.wires[start:end])


def _fault(wire: Wire, reading: Reading, now_s: float) -> GaugeFault | None:
    """Why a reading cannot be used; None where it can."""
    if reading.quality is not Quality.OK:
        return GaugeFault(wire.meaning, wire.channel, reading.quality, reading.detail)
    age_s = now_s - reading.time_s
    if age_s > wire.stale_after_s:
        detail = f"{age_s:.2f} s old, allowed {wire.stale_after_s:g} s"
        return GaugeFault(wire.meaning, wire.channel, Quality.STALE, detail)
    return None


class MachineWires:
    """The wiring of one configuration.

    Attributes
    ----------
    scale : in the order of the links.
    joint, frame : the two parts of the comparators.
    lengths : scales, joint and frame comparators.
    comparators : first the k = `joints` joint comparators, then t1..t3 and u1..u6 of the frame.
    tool_on_plate : whether the tool stands on the plate and the moving platform carries the work.
    """

    def __init__(self, configuration: Configuration, latest: Latest) -> None:
        wiring = configuration.wiring

        def wire(reference: str, meaning: str, sign: int = 1) -> Wire:
            channel = resolve_channel(reference, configuration.gauges, configuration.drivers)
            assert channel is not None, f"{reference} was checked when the configuration was loaded"
            own_limit_s = configuration.gauges[channel.split(".")[0]].stale_after_s
            stale_after_s = configuration.loop.stale_after_s if own_limit_s is None else own_limit_s
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
        self.joint = self.comparators.part(0, self.joints)
        self.frame = self.comparators.part(self.joints, len(self.comparators.wires))
        self.tool_on_plate = configuration.geometry.tool.on == "plate"
        self._quantities = {q.name: wire(q.gauge, q.name) for q in wiring.quantities}
        self.lengths = Wires([*self.scale.wires, *self.comparators.wires])

    @property
    def length_channels(self) -> tuple[str, ...]:
        """Every channel that machine zero needs."""
        return tuple(wire.channel for wire in self.length_wires)

    @property
    def length_wires(self) -> tuple[Wire, ...]:
        """Scales, joint and frame comparators."""
        return self.lengths.wires

    @property
    def all_wires(self) -> tuple[Wire, ...]:
        """Length gauges, then quantities."""
        return (*self.length_wires, *self._quantities.values())

    def lost(self, snapshot: Snapshot) -> Lost:
        """Which length gauges cannot be used, and why."""
        return self.scale.lost(snapshot).and_also(self.comparators.lost(snapshot))

    @property
    def quantity_names(self) -> tuple[str, ...]:
        """Names of temperatures, forces and the rest."""
        return tuple(self._quantities)

    @property
    def quantity_channels(self) -> dict[str, tuple[str, float]]:
        """Channel and stale limit (s) of each quantity, by name."""
        return {name: (wire.channel, wire.stale_after_s) for name, wire in self._quantities.items()}

    def quantity_wires(self, names: Sequence[str]) -> Wires:
        """The wires of these quantities, in this order. Raises KeyError for one that is not wired."""
        return Wires([self._quantities[name] for name in names])
