"""Reasons in words: which gauges cannot be used and why, in as few words as a person needs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from compd.gauge import Quality

# A reason goes to every client, in every setpoint; READINGS and STATUS name each gauge.
MAX_REASON_BYTES = 300
# The words by which SETPOINT, STATUS, page and command line say that time alone changes nothing.
WAITS_FOR_PERSON = "waits for a person"
_AND_MORE = " ... (STATUS names all)"


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
    text = ", ".join(map(_group_text, ordered))
    return Lost(text, any(group[0].quality is Quality.DISTRUSTED for group in ordered))


def waiting_text(channels: Iterable[str]) -> str:
    """What a person is waited for, where these channels are not believed; "" where all are."""
    gauges = list(dict.fromkeys(channel.partition(".")[0] for channel in channels))
    if not gauges:
        return ""
    accept = gauges[0] if len(gauges) == 1 else "all"
    return f"{WAITS_FOR_PERSON}: look at {', '.join(gauges)}, then `compd accept {accept}`"


def shortened(reason: str) -> str:
    """The reason with at most MAX_REASON_BYTES of UTF-8."""
    encoded = reason.encode()
    if len(encoded) <= MAX_REASON_BYTES:
        return reason
    kept = encoded[: MAX_REASON_BYTES - len(_AND_MORE)].decode(errors="ignore")
    return kept.rstrip(" ,;") + _AND_MORE


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
