"""Virtual time: actors as greenlets that one hub wakes in the order of time, the same way for the same seed."""

from __future__ import annotations

import heapq
import itertools
import random
import threading
import traceback
from collections.abc import Callable
from typing import Any

from greenlet import GreenletExit, getcurrent, greenlet

# Monotonic time (s) at which a world begins.
BEGIN_S = 1000.0
# Mean lateness (s) of a wake-up on an idle computer.
USUALLY_LATE_S = 40e-6

# Extra lateness (s) of one wake-up.
Lateness = Callable[[random.Random], float]


def usually_late(rng: random.Random) -> float:
    """Lateness (s) of a wake-up on an idle computer."""
    return rng.expovariate(1.0 / USUALLY_LATE_S)


class Actor(greenlet):
    """A thread of the daemon.

    Attributes
    ----------
    group : the process that it belongs to, which is paused and killed as a whole.
    turn : number of its present wait; a wake-up of an earlier one is void.
    """

    def __init__(self, run: Callable[[], object], group: str, parent: greenlet) -> None:
        super().__init__(run, parent)
        self.group = group
        self.turn = 0


class Hub:
    """The clock of a world, and the order of all that happens in it.

    Attributes
    ----------
    now_s : monotonic time, s.
    rng : of lateness and of everything else that is drawn while the world runs.
    lateness : of the wake-ups of each process; idle where it is not named.
    died : tracebacks of actors that ended by an exception.
    """

    def __init__(self, seed: int) -> None:
        self.now_s = BEGIN_S
        self.rng = random.Random(seed)
        self.lateness: dict[str, Lateness] = {}
        self.died: list[str] = []
        self._main = getcurrent()
        self._due: list[tuple[float, int, Callable[[], Any] | tuple[Actor, int]]] = []
        self._order = itertools.count()
        self._paused_until_s: dict[str, float] = {}

    # --- as a Clock ------------------------------------------------------------------------------------

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        if not event.is_set():
            self.sleep_until(self.now_s + max(timeout_s, 0.0))
        return event.is_set()

    # --- for actors ------------------------------------------------------------------------------------

    def sleep_until(self, time_s: float) -> None:
        """Let the present actor wait until `time_s` (s), and as late as its process wakes up."""
        actor = getcurrent()
        assert isinstance(actor, Actor), "only an actor can wait"
        late_s = self.lateness.get(actor.group, usually_late)(self.rng)
        self._push(max(time_s, self.now_s) + late_s, (actor, actor.turn))
        self._main.switch()

    def wake(self, actor: Actor | None) -> None:
        """End the wait of an actor, for bytes that have come."""
        if actor is not None and not actor.dead:
            actor.turn += 1
            self._push(self.now_s + self.lateness.get(actor.group, usually_late)(self.rng), (actor, actor.turn))

    # --- for the world ---------------------------------------------------------------------------------

    def at(self, time_s: float, do: Callable[[], Any]) -> None:
        """Call `do` at `time_s` (s); it must not wait."""
        self._push(max(time_s, self.now_s), do)

    def every(self, period_s: float, do: Callable[[], Any]) -> None:
        """Call `do` again and again; it must not wait."""

        def again() -> None:
            do()
            self.at(self.now_s + period_s, again)

        self.at(self.now_s, again)

    def spawn(self, run: Callable[[], Any], group: str) -> Actor:
        """Start an actor of a process."""

        def body() -> None:
            try:
                run()
            except GreenletExit:
                pass
            except Exception:  # noqa: BLE001  the world says that a part has died
                self.died.append(traceback.format_exc())

        actor = Actor(body, group, self._main)
        self._push(self.now_s, (actor, actor.turn))
        return actor

    def kill(self, actors: list[Actor]) -> None:
        """End actors at once, as SIGKILL does: nothing of them runs any more but what Python itself unwinds."""
        for actor in actors:
            actor.turn += 1
            if actor:
                actor.throw(GreenletExit)

    def pause(self, group: str, until_s: float) -> None:
        """Let no actor of a process run before `until_s` (s)."""
        self._paused_until_s[group] = until_s

    def run(self, duration_s: float) -> None:
        """Let `duration_s` (s) pass."""
        until_s = self.now_s + duration_s
        while self._due and self._due[0][0] <= until_s:
            time_s, _, what = heapq.heappop(self._due)
            if callable(what):
                self.now_s = max(self.now_s, time_s)
                what()
                continue
            actor, turn = what
            if actor.dead or turn != actor.turn:
                continue
            paused_until_s = self._paused_until_s.get(actor.group, 0.0)
            if paused_until_s > max(time_s, self.now_s):
                self._push(paused_until_s, what)
                continue
            self.now_s = max(self.now_s, time_s)
            actor.turn += 1
            actor.switch()
        self.now_s = until_s

    def _push(self, time_s: float, what: Callable[[], Any] | tuple[Actor, int]) -> None:
        heapq.heappush(self._due, (time_s, next(self._order), what))
