"""Which faults no data can show, judged from the readings alone: the errors that they make are not counted.

A fault is invisible while all that the gauges have shown could have come from a machine without a fault: each length
moves within what its gauge's configuration states, each quantity changes at its usual rate, noise is noise, and what
is measured twice agrees. A gap in which a display could have restarted is evidence of whatever happened in it, and a
step of one length at rest, while all others stand, is evidence of itself: it may be motion, but a bound can keep it.

    watch = Blindness.of(configuration)
    with listening(watch):                      # every reading and every failed poll of the daemon
        onset = watch.begins(now_s, "scale_1")  # the world injects a fault
        ...
        left_out([onset], setpoint.time_s)      # an invariant asks

What counts as visible can be shown (`possible_readings`); near the limits something that could be shown is left out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Self
from unittest.mock import patch

from compd.configuration import Configuration, resolve_channel
from compd.gauge import Quality, Reading
from compd.live.acquisition import quantity_limits
from compd.live.acquisition.polled_gauge import PolledGauge
from compd.live.acquisition.possible_motion import WINDOW_S
from compd.reading import ROUNDS_UNTIL_DUE
from compd.stated_noise import DIFFERENCE_SIGMAS, UNREST_MM
from compd.units import UM_PER_MM
from tests.worlds.possible_readings import PossibleChange, PossibleMotion, RepeatedValue
from tests.worlds.redundancy import FRAME_GIVE_UM, Relation, stated_relations

# Share of a new interval in the usual one.
_NEWEST = 0.05
# Readings of one place that show a part at rest.
_STANDS = 3


class Stated(NamedTuple):
    """What is stated of a channel: in mm, mm/s, mm/s2 for a length, in its unit for any other quantity.

    noise : largest difference of a reading from the truth. sigma : standard deviation; nan where it is not stated.
    per_s : fastest change. acceleration : nan for a quantity, which has none. lowest, highest : of the truth.
    restart_s : shortest time in which the device restarts.
    """

    noise: float
    sigma: float
    per_s: float = math.inf
    acceleration: float = math.nan
    lowest: float = -math.inf
    highest: float = math.inf
    restart_s: float = 0.5


@dataclass(eq=False)
class Onset:
    """One fault from its beginning on.

    channels : those that it changes. ended_s : when the last of its effects on the readings was over; inf.
    seen_s : time of the first evidence since it began, inf without one. why : that evidence.
    """

    began_s: float
    channels: frozenset[str]
    ended_s: float = math.inf
    seen_s: float = math.inf
    why: str = ""

    def hides_at(self, time_s: float) -> bool:
        """Whether it has an effect at this time (s) that nothing has shown yet."""
        return self.began_s <= time_s < min(self.seen_s, self.ended_s)


def left_out(onsets: Iterable[Onset], time_s: float) -> bool:
    """Whether the error of a setpoint of this time (s) is not counted: one of these faults hides in it.

    The world gives the faults that reach this setpoint. Where it can take the share of a hidden fault out of the error,
    it asks `Onset.hides_at` of each and counts the rest.
    """
    return any(onset.hides_at(time_s) for onset in onsets)


@dataclass(eq=False, slots=True)
class _Channel:
    """State of one channel. since_s : time of the first evidence against it, which lasts until a person accepts."""

    name: str
    stated: Stated
    possible: PossibleMotion | PossibleChange = field(init=False)
    repeated: RepeatedValue = field(init=False)
    restart_s: float = 0.5
    value: float = math.nan
    last_s: float = math.nan
    usual_s: float = math.nan
    missed: bool = False
    lost_s: float = math.inf
    since_s: float = math.inf
    stood: int = 0
    moved_s: float = -math.inf
    jumped_s: float = math.inf

    def __post_init__(self) -> None:
        stated = self.stated
        self.restart_s = stated.restart_s
        if math.isnan(stated.acceleration):
            self.possible = PossibleChange(stated.per_s, stated.noise, stated.lowest, stated.highest)
        else:
            self.possible = PossibleMotion(stated.acceleration, stated.noise, stated.per_s)
        self.repeated = RepeatedValue(stated.sigma)

    @property
    def is_length(self) -> bool:
        return not math.isnan(self.stated.acceleration)

    def steps(self, time_s: float, value: float) -> bool:
        """Whether it stood, has moved between two readings, and now has stood again for as long."""
        if abs(value - self.value) > 2 * self.stated.noise:
            self.jumped_s = self.last_s if self.stood >= _STANDS else math.inf
            self.stood, self.moved_s = 0, time_s
            return False
        self.stood += 1
        return self.stood == _STANDS and self.jumped_s < math.inf

    def restarted_s(self, now_s: float) -> float:
        """Time (s) from which its device could have restarted since the last reading; inf where it could not."""
        passed_s = now_s - self.last_s
        if self.lost_s <= now_s:
            return self.lost_s
        if passed_s < self.restart_s or not (self.missed or passed_s > ROUNDS_UNTIL_DUE * self.usual_s):
            return math.inf
        return self.last_s + self.restart_s


class _Compared:
    """A relation with what it began from. since_s : since when the residual is too large."""

    __slots__ = ("channels", "relation", "since_s", "start")

    def __init__(self, relation: Relation, channels: Sequence[_Channel]) -> None:
        self.relation, self.channels = relation, channels
        self.start: list[float] | None = None
        self.since_s = math.inf

    def contradicts(self, now_s: float) -> bool:
        """Whether the values of now belong together no more, for long enough."""
        values = [channel.value for channel in self.channels]
        if any(not now_s - channel.last_s < channel.restart_s for channel in self.channels):
            return False
        if self.start is None:
            self.start = values
        residual = self.relation.residual(values, self.start)
        if not abs(residual) > self.relation.within:
            self.since_s = math.inf
            return False
        self.since_s = min(self.since_s, now_s)
        return now_s - self.since_s >= self.relation.lasting_s


class Blindness:
    """Takes every reading and every failed poll, and says since when they contradict a machine without a fault."""

    def __init__(self, channels: dict[str, Stated], relations: Iterable[Relation] = ()) -> None:
        """`channels`: those that are wired, as "gauge.channel"."""
        self._channels = {name: _Channel(name, stated) for name, stated in channels.items()}
        self._compared = [
            _Compared(relation, [self._channels[name] for name in relation.channels]) for relation in relations
        ]
        self._open: list[Onset] = []

    @classmethod
    def of(
        cls, configuration: Configuration, frame_give_um: float = FRAME_GIVE_UM, more: Iterable[Relation] = ()
    ) -> Self:
        """What a configuration states. `more`: relations that it does not state, such as commands."""
        return cls(stated_channels(configuration), [*stated_relations(configuration, frame_give_um), *more])

    # --- what the gauges show --------------------------------------------------------------------------

    def read(self, name: str, time_s: float, value: float, late_s: float = WINDOW_S) -> None:
        """A reading of a channel; it was sampled at its time, or up to `late_s` (s) later."""
        channel = self._channels.get(name)
        if channel is None:
            return
        passed_s = time_s - channel.last_s
        if passed_s >= channel.restart_s or channel.lost_s <= time_s:
            self._note_gap(channel, time_s)
        if not channel.possible.follow(time_s, value, late_s):
            self._contradict((channel,), time_s, f"{name} cannot have come to {value:.6g}")
        if not channel.repeated.follow(value):
            self._contradict((channel,), time_s, f"{name} repeats {value:.6g}")
        if channel.is_length and channel.steps(time_s, value) and self._moved_alone(channel):
            began_s = channel.jumped_s - late_s
            stepped = [onset for onset in self._open if name in onset.channels and onset.began_s >= began_s]
            self._show(stepped, time_s, f"{name} moved alone")
        usual_s = channel.usual_s
        if math.isnan(usual_s):
            channel.usual_s = passed_s
        elif passed_s < 4 * usual_s and not channel.missed:
            channel.usual_s = usual_s + _NEWEST * (passed_s - usual_s)
        channel.last_s, channel.value = time_s, value
        channel.missed, channel.lost_s = False, math.inf

    def miss(self, gauge: str, time_s: float, lost: bool = False) -> None:
        """A poll of a gauge, or of one of its channels, gave no value. lost : its line is lost."""
        for channel in self._of(gauge):
            channel.missed = True
            if lost:
                channel.lost_s = min(channel.lost_s, time_s)
            self._note_gap(channel, time_s)

    def look(self, now_s: float) -> None:
        """Compare the channels with each other; ten times a second suffice."""
        for compared in self._compared:
            if compared.contradicts(now_s):
                self._contradict(compared.channels, now_s, f"{compared.relation.channels[0]} and others disagree")
        for channel in {name for onset in self._open for name in onset.channels}:
            self._note_gap(self._channels[channel], now_s)

    def accept(self, gauge: str = "") -> None:
        """A person has looked at a gauge, or at all of them: what it shows now is taken for right."""
        accepted = self._of(gauge)
        for channel in accepted:
            channel.since_s = math.inf
        for compared in self._compared:
            if any(channel in accepted for channel in compared.channels):
                compared.start, compared.since_s = None, math.inf

    # --- what is asked ---------------------------------------------------------------------------------

    def begins(self, time_s: float, *gauges: str) -> Onset:
        """A fault of these gauges or channels begins; without a name one that may change any of them.

        A fault that changes once more, as a display that restarts, has another onset for that.
        """
        channels = frozenset(channel.name for gauge in gauges or ("",) for channel in self._of(gauge))
        onset = Onset(time_s, channels)
        self._open.append(onset)
        return onset

    def ends(self, onset: Onset, time_s: float) -> None:
        """Its effect on the readings is over. For one that leaves another count it never is."""
        onset.ended_s = time_s
        self._open = [each for each in self._open if each is not onset]

    def since_s(self, gauge: str = "") -> float:
        """Since when (s) the readings of a gauge contradict a machine without a fault, or those of any; inf: they do
        not."""
        return min((channel.since_s for channel in self._of(gauge)), default=math.inf)

    def due_s(self, name: str) -> float:
        """From a reading of a channel to the time from which the next one is overdue, s; inf before two of them."""
        usual_s = self._channels[name].usual_s
        return math.inf if math.isnan(usual_s) else ROUNDS_UNTIL_DUE * usual_s

    # --- evidence --------------------------------------------------------------------------------------

    def _of(self, gauge: str) -> list[_Channel]:
        """Channels of a gauge, by its name or theirs; all for ""."""
        if gauge in self._channels:
            return [self._channels[gauge]]
        return [channel for name, channel in self._channels.items() if not gauge or name.startswith(f"{gauge}.")]

    def _moved_alone(self, channel: _Channel) -> bool:
        """Whether all other lengths stand since before its step. A machine can do that, but a bound can remember it."""
        others = [other for other in self._channels.values() if other.is_length and other is not channel]
        return bool(others) and all(other.moved_s < channel.jumped_s for other in others)

    def _contradict(self, channels: Sequence[_Channel], time_s: float, why: str) -> None:
        for channel in channels:
            channel.since_s = min(channel.since_s, time_s)
        names = {channel.name for channel in channels}
        self._show([onset for onset in self._open if onset.began_s <= time_s and onset.channels & names], time_s, why)

    def _note_gap(self, channel: _Channel, now_s: float) -> None:
        """A gap shows what happened in it, and says nothing of what was before."""
        restarted_s = channel.restarted_s(now_s)
        if restarted_s == math.inf:
            return
        in_gap = [
            onset for onset in self._open if channel.name in onset.channels and channel.last_s <= onset.began_s <= now_s
        ]
        for onset in in_gap:
            self._show([onset], max(restarted_s, onset.began_s), f"{channel.name} was away")

    def _show(self, onsets: Iterable[Onset], time_s: float, why: str) -> None:
        for onset in onsets:
            onset.seen_s, onset.why = min((onset.seen_s, onset.why), (time_s, why))
        self._open = [onset for onset in self._open if onset.seen_s == math.inf]


def stated_channels(configuration: Configuration) -> dict[str, Stated]:
    """What a configuration states of each channel that is wired."""
    wiring, stated = configuration.wiring, {}
    for reference in [wire.gauge for wires in (wiring.scale, wiring.joint, wiring.frame) for wire in wires]:
        channel = resolve_channel(reference, configuration.gauges, configuration.drivers)
        assert channel is not None, f"{reference} was checked when the configuration was loaded"
        gauge = channel.split(".")[0]
        options, sigma_mm = configuration.gauges[gauge], configuration.noise_of(channel).um / UM_PER_MM
        stated[channel] = Stated(
            0.5 * UNREST_MM if math.isnan(sigma_mm) else DIFFERENCE_SIGMAS * sigma_mm,
            sigma_mm,
            options.fastest_mm_per_s or math.inf,
            options.acceleration_mm_per_s2 or math.inf,
            restart_s=options.restart_s,
        )
    for quantity in wiring.quantities:
        channel = resolve_channel(quantity.gauge, configuration.gauges, configuration.drivers)
        assert channel is not None, f"{quantity.gauge} was checked when the configuration was loaded"
        limits = quantity_limits(quantity)
        noise = 0.5 * limits.tolerance if quantity.noise is None else DIFFERENCE_SIGMAS * quantity.noise
        gauge = channel.split(".")[0]
        stated[channel] = Stated(
            noise,
            quantity.noise or math.nan,
            min(limits.usual_per_s, limits.fastest_per_s),
            lowest=limits.low,
            highest=limits.high,
            restart_s=configuration.gauges[gauge].restart_s,
        )
    return stated


@contextmanager
def listening(watch: Blindness) -> Iterator[None]:
    """Within the block the polls of every gauge of this process go to `watch`, before the daemon judges them."""
    put, receive, fail, lose = PolledGauge.put, PolledGauge.receive, PolledGauge.fail, PolledGauge.lose

    def note(gauge: PolledGauge, index: int, reading: Reading, late_s: float) -> None:
        channel = f"{gauge.name}.{gauge.driver.channels[index].name}"
        if reading.ok:
            watch.read(channel, reading.time_s, reading.value, late_s)
        else:
            watch.miss(channel, reading.time_s, reading.quality is Quality.LINE_LOST)

    def noted_put(gauge: PolledGauge, readings: Sequence[Reading], now_s: float) -> None:
        for index, reading in enumerate(readings):
            note(gauge, index, reading, gauge._trust._window_s)
        put(gauge, readings, now_s)

    def noted_receive(gauge: PolledGauge, received: Sequence[Any], now_s: float) -> None:
        for heard in received:
            note(gauge, heard.channel_index, heard.reading, heard.window_s + WINDOW_S)
        receive(gauge, received, now_s)

    def noted_fail(gauge: PolledGauge, quality: Quality, detail: str, now_s: float) -> None:
        watch.miss(gauge.name, now_s)
        fail(gauge, quality, detail, now_s)

    def noted_lose(gauge: PolledGauge, quality: Quality, detail: str, now_s: float) -> None:
        watch.miss(gauge.name, now_s, lost=True)
        lose(gauge, quality, detail, now_s)

    with (
        patch.object(PolledGauge, "put", noted_put),
        patch.object(PolledGauge, "receive", noted_receive),
        patch.object(PolledGauge, "fail", noted_fail),
        patch.object(PolledGauge, "lose", noted_lose),
    ):
        yield
