"""What is known of every wired channel beyond its newest reading: the last one that was believed, and since when not.

The readings themselves are in `Latest`. This outlives a process that polls gauges, so that a gauge which came back with
another value is not believed only because that process was started anew.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from compd.live.memory.shared_array import shared_counters, shared_floats
from compd.live.memory.shared_message import SharedMessage


class Doubt(IntEnum):
    """Why a channel's next reading is not simply believed."""

    NONE = 0
    LOST = 1
    """The gauge was away: what it shows next must be what it showed last."""
    RETURNED = 2
    """It came back with another value, `amount` mm away."""
    MOVED_MEANWHILE = 3
    """It came back with the same value, but another gauge, number `amount`, has moved meanwhile."""
    JUMPED = 4
    """It jumped by `amount`, further than what is measured can move or change."""
    VOTED = 5
    """Other gauges contradict it; `TrustMemory.evidence` says how."""
    IMPLAUSIBLE = 6
    """A quantity shows `amount`, which is beyond its plausible range."""
    APART = 7
    """A quantity is `amount` away from its neighbours, the other quantities of its unit."""
    AT_ZERO = 8
    """A scale shows zero after its power may have been off: with any direction and unit it would."""
    REPLUGGED = 9
    """Its line is at another port than before, `TrustMemory.evidence`: it may be another gauge."""
    UNWITNESSED = 10
    """It came back with the same value, but no scale has kept its power to say that the machine has not moved."""

    @property
    def until_accepted(self) -> bool:
        """Whether it lasts until a person accepts the gauge."""
        return self is not Doubt.NONE and self is not Doubt.LOST


_DOUBTS = tuple(Doubt)
# Readings of each channel that are kept for the others, and for a process that takes over: a second at 4 ms each.
RECENT = 256


class TrustMemory:
    """Shared by the processes that are forked from now on. A channel's numbers have one writer, its line's thread, but
    for `accepted`, which the service writes, and `voted` and `suspected`, which the votes write.

    Attributes
    ----------
    channels : "gauge.channel" of every length channel, the scales first, then of every quantity. index : of each in the
        arrays, all (n,). Their values are in the channel's own unit, `unit`: mm of a length.
    lengths : how many of them are lengths. scales : how many are scales.
    value, time_s : the last reading that was believed, and its monotonic time, s; nan before the first.
    shown, shown_s : the last value that the gauge gave, believed or not, and its time, s; nan before the first.
    tolerance_mm : by which a reading may differ from another one of the same value; of a quantity in its unit.
    witness : (lengths, lengths), row i: the values of all lengths at the last believed reading of length i, mm.
    lost_s : monotonic time at which the channel was lost, s.
    power_lost : 1 where the gauge itself may have been without power since its last reading.
    returns : 1 where the gauge shows the same value again when it is back, whatever has happened meanwhile.
    doubt : a `Doubt`. amount : what it says of it.
    repeats : how many polls in a row have given the very same value. changes : how many polls have given another one.
    first_change_s, last_change_s : when the first and the last of these were, s.
    step_mm : the smallest change seen, of a quantity in its unit; inf before the first.
    scatter_mm : standard deviation of its readings at rest, as measured, mm; nan before it is known.
    stepped, stepped_mm, stepped_s : how often it has gone from one place where it stood to the next; the sum of those
        steps that no reading shows on the way, mm; and when the last one began, s; nan before the first.
    accepted, obeyed : how often a person has accepted the channel, and how often its thread has followed.
    voted, handled : how often a vote has named the channel, and how often its thread has followed.
    suspected : 1 while a vote waits for more evidence against the channel: it has no value meanwhile.
    evidence : of the votes, by channel.
    warnings : by channel: what is to be looked at, of one that is believed all the same.
    """

    def __init__(
        self, channels: Sequence[str], tolerance_mm: Sequence[float], units: Sequence[str] = (), scales: int = 0
    ) -> None:
        """`units`: of the quantities, which are the last channels; all others are lengths. `scales`: how many
        of these, from the first, are scales."""
        self.channels = tuple(channels)
        self.scales = scales
        self.lengths = len(self.channels) - len(units)
        self._units = ("mm",) * self.lengths + tuple(units)
        self.index: Mapping[str, int] = {name: i for i, name in enumerate(self.channels)}
        self._gauges = [channel.partition(".")[0] for channel in self.channels]
        n = len(self.channels)
        self.tolerance_mm = np.array(tolerance_mm, dtype=float)
        self.value, self.time_s, self.shown, self.shown_s, self.lost_s = (shared_floats(max(n, 1)) for _ in range(5))
        for array in (self.value, self.time_s, self.shown, self.shown_s, self.lost_s):
            array[:] = math.nan
        m = self.lengths
        self.witness = shared_floats(max(m * m, 1))[: m * m].reshape(m, m)
        self.doubt, self.amount, self.step_mm = (shared_floats(max(n, 1)) for _ in range(3))
        self.repeats, self.changes = (shared_floats(max(n, 1)) for _ in range(2))
        self.first_change_s, self.last_change_s = (shared_floats(max(n, 1)) for _ in range(2))
        self.step_mm[:] = math.inf
        self.scatter_mm, self.stepped, self.stepped_mm, self.stepped_s = (shared_floats(max(n, 1)) for _ in range(4))
        self.scatter_mm[:] = self.stepped_s[:] = math.nan
        self.accepted, self.obeyed, self.voted, self.handled = (shared_counters(max(n, 1)) for _ in range(4))
        self.suspected = shared_counters(max(n, 1))
        self.evidence, self.warnings = SharedMessage(), SharedMessage()
        self.power_lost, self.returns = (shared_floats(max(n, 1)) for _ in range(2))
        self._recent = shared_floats(max(n, 1) * RECENT * 2).reshape(max(n, 1), RECENT, 2)  # time, s, and value, mm
        self._recent[:] = math.nan
        self._believed = shared_counters(max(n, 1))

    def unit(self, i: int) -> str:
        """Of the values of channel `i`."""
        return self._units[i]

    def doubt_of(self, i: int) -> Doubt:
        """Why the next reading of channel `i` is not simply believed.

        Use this and `undoubted`: NumPy takes 13 us to compare a number with a member of an Enum.
        """
        return _DOUBTS[int(self.doubt[i])]

    @property
    def undoubted(self) -> NDArray[np.bool_]:
        """(n,) channels whose next reading is simply believed."""
        return np.asarray(self.doubt == 0.0)  # Doubt.NONE

    def show(self, i: int, value: float, time_s: float) -> None:
        """Note what the gauge of channel `i` gave at `time_s` (s), believed or not, and count how often it repeats.

        The same reading counts once.
        """
        if (value, time_s) == (self.shown[i], self.shown_s[i]):
            return
        change = abs(value - float(self.shown[i]))
        if change == 0.0:
            self.repeats[i] += 1
        elif change > 0.0:
            self.repeats[i] = 0
            if self.changes[i] == 0:
                self.first_change_s[i] = time_s
            self.changes[i] += 1
            self.last_change_s[i] = time_s
            self.step_mm[i] = min(float(self.step_mm[i]), change)
        self.shown[i], self.shown_s[i] = value, time_s

    def lose(self, i: int, now_s: float, power: bool = False) -> None:
        """Note that channel `i` is away from now on (s). power : its gauge may be without power."""
        if self.doubt_of(i) is Doubt.NONE:
            self.lost_s[i] = now_s
            self.doubt[i] = Doubt.LOST
        if power:
            self.power_lost[i] = 1.0

    def needs_person(self, i: int) -> bool:
        """Whether a person has to accept channel `i`, or will have to when it is back, as the machine has moved."""
        if self.doubt_of(i).until_accepted:
            return True
        n = self.lengths
        if self.doubt_of(i) is not Doubt.LOST or i >= n or self.returns[i]:
            return False
        moved = np.abs(self.value[:n] - self.witness[i]) > self.tolerance_mm[:n]
        return bool((moved & self.undoubted[:n]).any())

    def end_order(self, i: int) -> None:
        """An order to believe channel `i` is over: followed, or about what the gauge showed before it was away."""
        self.obeyed[i] = self.accepted[i]

    def distrust(self, i: int, doubt: Doubt, amount: float) -> None:
        """Believe channel `i` no more until a person accepts it."""
        self.amount[i] = amount
        self.doubt[i] = doubt

    def believe(self, i: int, value: float, time_s: float) -> None:
        """Note a reading of channel `i` (in its unit, s) that is believed."""
        newest = self._recent[i, self._believed[i] % RECENT]
        newest[0] = math.nan  # whoever reads in between leaves it out
        newest[1] = value
        newest[0] = time_s
        self._believed[i] += 1
        self.value[i], self.time_s[i] = value, time_s
        if i < self.lengths:
            self.witness[i] = self.value[: self.lengths]
        self.doubt[i] = Doubt.NONE
        self.power_lost[i] = 0.0

    def begin(self, i: int) -> None:
        """Forget the readings of channel `i`: it counts anew."""
        self._recent[i] = math.nan

    def recent(self, i: int) -> NDArray[np.float64]:
        """(k, 2) monotonic time (s) and value (mm) of the last readings of channel `i` that were believed, in order."""
        readings = self._recent[i].copy()
        readings = readings[~np.isnan(readings[:, 0])]
        return np.asarray(readings[np.argsort(readings[:, 0], kind="stable")])

    def accept(self, name: str) -> list[str]:
        """Believe what the channels of `name` show from now on, and return those that were not believed.

        name : a gauge, a "gauge.channel", or "all". Raises ValueError where no such gauge is wired.
        """
        channels = [c for c in self.channels if name in ("all", c, c.partition(".")[0])]
        if not channels and name != "all":
            gauges = dict.fromkeys(self._gauges)
            raise ValueError(f"no wired gauge is called {name[:40]!r}, allowed: all, {', '.join(gauges)}")
        doubted = [c for c in channels if self.doubt_of(self.index[c]).until_accepted]
        for channel in channels:
            self.accepted[self.index[channel]] += 1
        return doubted

    def vote(self, evidence: Mapping[str, str]) -> None:
        """Name channels that other gauges contradict, each with the evidence."""
        self.tell(evidence)
        for channel in evidence:
            self.voted[self.index[channel]] += 1

    def tell(self, evidence: Mapping[str, str]) -> None:
        """Keep the evidence against channels, by channel."""
        if evidence:
            self.evidence.write({**(self.evidence.read() or {}), **evidence})

    def distrust_ports(self, changes: Mapping[str, str]) -> None:
        """Believe no channel of these gauges until a person accepts it: each is at another port, as the text says."""
        changed = {i: changes[gauge] for i, gauge in enumerate(self._gauges) if gauge in changes}
        self.tell({self.channels[i]: text for i, text in changed.items()})
        for i in changed:
            self.distrust(i, Doubt.REPLUGGED, math.nan)

    def short_name(self, i: int) -> str:
        """What `compd accept` is given: the gauge alone where it has one length channel."""
        gauge = self._gauges[i]
        return gauge if self._gauges.count(gauge) == 1 else self.channels[i]

    def explanation(self, i: int) -> str:
        """Why channel `i` is not believed, and what to do; "" where it is."""
        doubt, amount = self.doubt_of(i), float(self.amount[i])
        unit, accept = self.unit(i), f"then `compd accept {self.short_name(i)}`"
        mend = "reference it" if i < self.lengths else "look at it"
        match doubt:
            case Doubt.RETURNED:
                return f"came back {amount:.3f} mm away: reference it, {accept}"
            case Doubt.MOVED_MEANWHILE:
                return f"came back, but {self.short_name(int(amount))} has moved meanwhile: reference it, {accept}"
            case Doubt.JUMPED:
                return f"jumped by {amount:.3f} {unit}: {mend}, {accept}"
            case Doubt.IMPLAUSIBLE:
                return f"shows {amount:.6g} {unit}, which is not plausible: {mend}, {accept}"
            case Doubt.APART:
                return f"is {amount:+.3g} {unit} from its neighbours: {mend}, {accept}"
            case Doubt.VOTED:
                evidence = (self.evidence.read() or {}).get(self.channels[i], "other gauges contradict it")
                return f"{evidence}: look at it, {accept}"
            case Doubt.AT_ZERO:
                return f"shows zero, as before its power was off, with any direction and unit: look at these, {accept}"
            case Doubt.UNWITNESSED:
                return (
                    "came back with its value, but all scales were away and may count anew: "
                    f"look whether the machine stands where it stood, {accept}"
                )
            case Doubt.REPLUGGED:
                evidence = (self.evidence.read() or {}).get(self.channels[i], "its port is not that of before")
                return f"look whether it is this gauge, {accept}: {evidence}"  # what is too long is cut off
        return ""
