"""All faults of one line together: each sees what the ones before have left of a reply."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tests.injection.faults import Exchange, Fault, Sent


@dataclass
class FaultOfLine:
    """A fault since it began. number : of the replies that it has had."""

    fault: Fault
    since_s: float
    number: int = 0


def sent_through(faults: Sequence[FaultOfLine], exchange: Exchange, now_s: float) -> list[Sent]:
    """What the daemon gets of a reply from a line with all of these faults: those first that need it whole."""
    sent = [Sent(exchange.reply)]
    for one in sorted(faults, key=lambda one: not one.fault.needs_whole):
        sent = [piece for before in sent for piece in _through(one, before, exchange, now_s)]
        one.number += 1
    return sent


def _through(one: FaultOfLine, before: Sent, exchange: Exchange, now_s: float) -> list[Sent]:
    seen = replace(exchange, reply=before.data, number=one.number, elapsed_s=now_s - one.since_s)
    return [
        Sent(after.data, before.delay_s + after.delay_s, max(before.gap_s, after.gap_s))
        for after in one.fault.send(seen)
    ]
