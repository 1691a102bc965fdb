"""Play one world step by step: `python -m tests.worlds.defects.play SEED MINUTES RATES [MACHINE]`.

Each line of the standard input lets `STEP_S` pass and is answered by one line: what did not hold meanwhile. The world
ends with the input. Only `tests.worlds.defects.find` calls it.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from typing import NamedTuple

from tests.worlds.command import Order
from tests.worlds.run import play
from tests.worlds.watch import Watch

STEP_S = 5.0


class Mark(NamedTuple):
    """An invariant did not hold at this time (s of the world), beside these kinds of fault."""

    what: str
    blame: str
    time_s: float
    text: str


class Steps:
    """Ends a world's wait for the next step; called by `play` four times a simulated second."""

    def __init__(self) -> None:
        self._began_s: float | None = None
        self._reached_s = 0.0
        self._counts: Counter[tuple[str, str]] = Counter()
        self._marks: list[Mark] = []

    def __call__(self, watch: Watch) -> bool:
        """Whether the world ends here."""
        now_s = watch.world.hub.now_s
        if self._began_s is None:
            self._began_s = now_s
        time_s = now_s - self._began_s
        for key, finding in watch.found.items():
            if finding.count > self._counts[key]:
                self._counts[key] = finding.count
                self._marks.append(Mark(*key, time_s, finding.text))
        if time_s < self._reached_s:
            return False
        self._reached_s += STEP_S
        return not self._answer(time_s)

    def end(self, time_s: float) -> None:
        """The world is over."""
        self._answer(time_s)

    def _answer(self, time_s: float) -> bool:
        """Whether there is a next step."""
        print(json.dumps({"time_s": time_s, "marks": self._marks}), flush=True)
        self._marks = []
        return bool(sys.stdin.readline())


def main(seed: str, minutes: str, rates: str, machine: str = "") -> None:
    """Play the world of these options of `python -m tests.worlds`."""
    steps = Steps()
    play(Order(int(seed), float(minutes), rates, machine).plan, until=steps)
    steps.end(60 * float(minutes))


if __name__ == "__main__":
    main(*sys.argv[1:])
