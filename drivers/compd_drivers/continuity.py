"""For protocols without a checksum: a damaged digit is still a digit, but a machine part does not jump.

A value that has moved further than it can since the last poll is asked for once more. It counts when the second
answer agrees with the first (it did jump: somebody set the display) or with the last one (the first was damaged).
What noise on the wire can still feign is as small as what the part can move from one poll to the next: after a
poll that failed, nothing is remembered, and two answers must agree.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from compd.gauge import LineFault, Quality, Reading

# Last digits of a display that stands still
UNREST_MM = 0.001
# After a longer silence the last value says nothing about this one.
MEMORY_S = 1.0


class Continuity:
    """Remembers one gauge's last readings. Used by one thread."""

    def __init__(self, fastest_mm_per_s: float) -> None:
        """`fastest_mm_per_s`: the fastest that the measured part ever moves."""
        self._fastest_mm_per_s = fastest_mm_per_s
        self._last: Sequence[Reading | None] = ()

    def read(self, ask: Callable[[], Sequence[Reading]]) -> Sequence[Reading]:
        """The readings of one poll by `ask`, or of a second one. Raises LineFault: MISMATCH when no two agree."""
        remembered, self._last = self._last, ()
        first = ask()
        last = remembered or [None] * len(first)
        if not all(map(self._follows, first, last)):
            second = ask()
            for now, before, earlier in zip(second, first, last, strict=True):
                if not self._follows(now, before) and not self._follows(now, earlier):
                    raise LineFault(Quality.MISMATCH, _disagreement(now, before, earlier))
            first = second
        self._last = [now if now.ok else earlier for now, earlier in zip(first, last, strict=True)]
        return first

    def _follows(self, now: Reading, before: Reading | None) -> bool:
        """Whether the part can have moved so far in the time between; no value needs no proof."""
        if not now.ok:
            return True
        if before is None or not before.ok:
            return False
        passed_s = now.time_s - before.time_s
        return passed_s <= MEMORY_S and abs(now.value - before.value) <= UNREST_MM + self._fastest_mm_per_s * passed_s


def _disagreement(now: Reading, before: Reading, earlier: Reading | None) -> str:
    values = [f"{reading.value:.4f}" for reading in (earlier, before, now) if reading is not None]
    return f"values that no part can follow, no two agree: {', '.join(values)} mm"
