"""Reasons in words: which gauges cannot be used and why, in as few words as a person needs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from compd.gauge import Quality

# Longest text of the gauges that cannot be used, bytes: with details, and with names alone. Beyond it they are counted.
# A reason goes to every client, in every setpoint; READINGS and STATUS have each gauge.
MAX_DETAILED_BYTES, MAX_NAMED_BYTES = 250, 500
# The words by which SETPOINT, STATUS, page and command line say that time alone changes nothing.
WAITS_FOR_PERSON = "waits for a person"


class GaugeFault(NamedTuple):
    """A reading that cannot be used.

    meaning : what the channel measures, as "joint 4". channel : "gauge.channel". quality, detail : why it cannot.
    """

    meaning: str
    channel: str
    quality: Quality
    detail: str


class Lost(NamedTuple):
    """Which readings cannot be used, and why. False where all can.

    text : for people. distrusted : whether a person has to accept one of the gauges.
    """

    text: str = ""
    distrusted: bool = False

    def __bool__(self) -> bool:
        return bool(self.text)

    def __str__(self) -> str:
        return f"{WAITS_FOR_PERSON}: {self.text}" if self.distrusted else self.text

    def and_also(self, other: Lost) -> Lost:
        """Both together."""
        if not (self and other):
            return self or other
        return Lost(f"{self.text}, {other.text}", self.distrusted or other.distrusted)


def lost(faults: Iterable[GaugeFault]) -> Lost:
    """Faults grouped: "joint 1 to 9 (joints): line_lost (read: the port has hung up)"."""
    groups: dict[tuple[str, Quality, str], list[GaugeFault]] = {}
    for fault in faults:
        # ages and distances differ, the reason does not
        detail = "" if fault.quality in (Quality.STALE, Quality.DISTRUSTED) else fault.detail
        groups.setdefault((fault.channel.partition(".")[0], fault.quality, detail), []).append(fault)
    # a gauge that waits for a person comes first, that it is not cut off
    ordered = sorted(groups.values(), key=lambda group: group[0].quality is not Quality.DISTRUSTED)
    waiting = [group for group in ordered if group[0].quality is Quality.DISTRUSTED]
    detailed, (named, counted) = ", ".join(map(_group_text, ordered)), _coarser(ordered)
    if len(detailed.encode()) <= MAX_DETAILED_BYTES:
        return Lost(detailed, bool(waiting))
    advice = f"; {_look_at([group[0].channel for group in waiting])}" if waiting else ""
    texts = (f"{named}{advice}", f"{counted}{advice}")
    few = (text for text in texts if len(text.encode()) <= MAX_NAMED_BYTES)
    return Lost(next(few, f"{counted}{'; then `compd accept all`' * bool(waiting)}"), bool(waiting))


def waiting_text(channels: Iterable[str]) -> str:
    """What a person is waited for, where these channels are not believed; "" where all are."""
    channels = list(channels)
    return f"{WAITS_FOR_PERSON}: {_look_at(channels)}" if channels else ""


def _look_at(channels: Sequence[str]) -> str:
    gauges = list(dict.fromkeys(channel.partition(".")[0] for channel in channels))
    accept = gauges[0] if len(gauges) == 1 else "all"
    return f"look at {', '.join(gauges)}, then `compd accept {accept}`"


def _coarser(groups: Sequence[Sequence[GaugeFault]]) -> tuple[str, str]:
    """Groups without details: each gauge by name, "joint 1 to 9, frame t1: stale", and the numbers of gauges."""
    by_quality: dict[Quality, list[str]] = {}
    for group in groups:
        by_quality.setdefault(group[0].quality, []).extend(fault.meaning for fault in group)
    named, counted = [], []
    for quality, meanings in by_quality.items():
        by_word: dict[str, list[str]] = {}
        for meaning in meanings:
            by_word.setdefault(meaning.rpartition(" ")[0], []).append(meaning)
        named.append(f"{', '.join(map(_runs, by_word.values()))}: {quality}")
        counted.append(f"{len(meanings)} gauge{'s' * (len(meanings) != 1)}: {quality}")
    return "; ".join(named), "; ".join(counted)


def _runs(meanings: Sequence[str]) -> str:
    """ "joint 1 to 3, 7, 9" of meanings with one word; those of other words follow as they are."""
    word = meanings[0].rpartition(" ")[0]
    numbers = [meaning.removeprefix(word).strip() for meaning in meanings]
    if not word or not all(number.isdecimal() for number in numbers):
        return ", ".join(meanings)
    runs: list[list[int]] = []
    for number in sorted(map(int, numbers)):
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return f"{word} " + ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)


def _group_text(group: list[GaugeFault]) -> str:
    first = group[0]
    gauge = first.channel.partition(".")[0] if len(group) > 1 else first.channel
    detail = f" ({first.detail})".replace(f"accept {first.channel}", f"accept {gauge}") if first.detail else ""
    return f"{_meanings([fault.meaning for fault in group])} ({gauge}): {first.quality}{detail}"


def _meanings(meanings: list[str]) -> str:
    """ "joint 1 to 9", "frame t1 to t3"; what has no number in common is listed."""
    words = [meaning.rpartition(" ") for meaning in meanings]
    if len(meanings) > 2 and len({word for word, _, _ in words}) == 1 and words[0][0]:
        return f"{meanings[0]} to {words[-1][2]}"
    return ", ".join(meanings)
