"""The wiring: which channel measures what, and the signed values since machine zero in a snapshot of readings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration, resolve_channel
from compd.gauge import Quality, Reading
from compd.live.machine.machine_zero import MachineZero
from compd.live.machine.reasons import GaugeFault, Lost, lost
from compd.live.machine.wired_readings import age_bounds_mm, read_values, speed_bounds_mm_per_s
from compd.live.memory import Latest, Snapshot
from compd.operation_settings import FRAME_DISTANCES, FrameWire
from compd.stated_noise import NOT_STATED, StatedNoise, tolerance_mm

ALL_GOOD = Lost()


class Beyond(NamedTuple):
    """Quantities that are taken as the nearer end of their range. text : which, for people. by : how far each is beyond
    it, by name, in its unit."""

    text: str
    by: Mapping[str, float]


class WiredValues(NamedTuple):
    """The values of k wires in one snapshot.

    values : (k), sign * (reading - zero) in the unit of each wire: mm since machine zero for lengths, the gauge's own
        for temperatures and other quantities, whose zero is 0. nan where the reading cannot be used.
    oldest_s, newest_s : monotonic times of the oldest and of the newest reading; inf and -inf without wires.
    lost : which readings cannot be used, and why.
    beyond : what was beyond the range that the values are limited to; None for nothing.
    """

    values: FloatArray
    oldest_s: float
    newest_s: float
    lost: Lost
    beyond: Beyond | None = None


class Wire(NamedTuple):
    """What one channel measures.

    channel : "gauge.channel". meaning : for people, as "joint 4". slot : its index in a snapshot. sign : +1 or -1.
    stale_after_s : age from which a reading must not be used.
    noise : of a length, how much it scatters, and who says so.
    fastest_mm_per_s, acceleration_mm_per_s2 : of a length, how what it measures can move; inf without a limit.
    """

    channel: str
    meaning: str
    slot: int
    sign: int
    stale_after_s: float
    noise: StatedNoise = NOT_STATED
    fastest_mm_per_s: float = math.inf
    acceleration_mm_per_s2: float = math.inf


class Wires:
    """The wires of one kind (scales, comparators or quantities), in the order of the machine's numbering."""

    def __init__(self, wires: Sequence[Wire]) -> None:
        self.wires = tuple(wires)
        self._wired = np.array([wire.slot for wire in wires], dtype=np.int64)
        self._stale_after_s = np.array([wire.stale_after_s for wire in wires], dtype=float)
        self._sign = np.array([wire.sign for wire in wires], dtype=float)
        self._fastest = np.array([wire.fastest_mm_per_s for wire in wires], dtype=float)
        self._tolerance_mm = np.array([tolerance_mm(wire.noise.um) for wire in wires], dtype=float)
        self.acceleration_mm_per_s2 = np.array([wire.acceleration_mm_per_s2 for wire in wires], dtype=float)

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

    def speed_bound_mm_per_s(self, snapshot: Snapshot) -> FloatArray:
        """(k) how fast each length moves at most, by its last readings, mm/s; nan where that is not known yet."""
        speeds = np.empty(len(self.wires))
        speed_bounds_mm_per_s(snapshot.readings.slots, self._wired, speeds)
        return speeds

    def scatter_mm(self, snapshot: Snapshot) -> FloatArray:
        """(k) standard deviation of one reading of each length, as measured at rest, mm; nan before it is known."""
        scatter_mm: FloatArray = snapshot.readings.slots["scatter_mm"][self._wired]
        return scatter_mm

    def age_bound_mm(
        self, snapshot: Snapshot, scales: int, extrapolate: bool, largest_mm: float
    ) -> tuple[FloatArray, float]:
        """(k) by how much each length may be wrong by the age of its reading, mm, and how fast the machine moves, mm/s.

        0 for a length that is not good, nan where it is not known how it moves, inf where nothing limits how it may
        have moved since. The speed is the largest that the scales show which answer; inf where none does.
        scales : so many of the wires, the first ones, are scales.  largest_mm : of the others, none is further off.
        """
        bounds_mm = np.empty(len(self.wires))
        speed_mm_per_s = age_bounds_mm(
            snapshot.readings.slots,
            self._wired,
            scales,
            snapshot.time_s,
            extrapolate,
            self._fastest,
            self.acceleration_mm_per_s2,
            self._tolerance_mm,
            largest_mm,
            bounds_mm,
        )
        return bounds_mm, speed_mm_per_s

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
    """The wiring of one configuration."""

    def __init__(self, configuration: Configuration, latest: Latest) -> None:
        wiring = configuration.wiring

        def wire(reference: str, meaning: str, sign: int = 1) -> Wire:
            channel = resolve_channel(reference, configuration.gauges, configuration.drivers)
            assert channel is not None, f"{reference} was checked when the configuration was loaded"
            options = configuration.gauges[channel.split(".")[0]]
            return Wire(
                channel,
                meaning,
                latest.index[channel],
                sign,
                configuration.loop.stale_after_s if options.stale_after_s is None else options.stale_after_s,
                configuration.noise_of(channel),
                options.fastest_mm_per_s or math.inf,
                options.acceleration_mm_per_s2 or math.inf,
            )

        frame: dict[str, FrameWire] = {entry.distance: entry for entry in wiring.frame}
        scale = sorted(wiring.scale, key=lambda entry: entry.link)
        self.scale = Wires([wire(w.gauge, f"scale {w.link}", w.sign) for w in scale])  #: in the order of the links
        #: first the k = `joints` joint comparators, then those of t1..t3 and u1..u6 of the frame.
        self.comparators = Wires(
            [
                *(wire(w.gauge, f"joint {k}", w.sign) for k, w in enumerate(wiring.joint, start=1)),
                *(wire(frame[d].gauge, f"frame {d}", frame[d].sign) for d in FRAME_DISTANCES if d in frame),
            ]
        )
        self.joints = len(wiring.joint)
        self.joint = self.comparators.part(0, self.joints)  #: joint, frame: the two parts of the comparators
        self.frame = self.comparators.part(self.joints, len(self.comparators.wires))
        #: whether the tool stands on the plate and the moving platform carries the work
        self.tool_on_plate = configuration.external is None and configuration.geometry.tool.on == "plate"
        self._quantities = {q.name: wire(q.gauge, q.name) for q in wiring.quantities}
        self.lengths = Wires([*self.scale.wires, *self.comparators.wires])  #: scales, joint and frame comparators

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
