"""Virtual time: actors as greenlets that one hub wakes in the order of time, the same way for the same seed."""

from __future__ import annotations

import heapq
import itertools
import math
import random
import select
import threading
from collections.abc import Callable
from contextlib import suppress
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
    killed : whether it is to run no more.
    """

    def __init__(self, run: Callable[[], object], group: str, parent: greenlet) -> None:
        super().__init__(run, parent)
        self.group = group
        self.turn = 0
        self.killed = False


def this_actor() -> Actor:
    """The one that runs. Only an actor can wait."""
    actor = getcurrent()
    assert isinstance(actor, Actor), "only an actor can wait"
    return actor


class Hub:
    """The clock of a world, and the order of all that happens in it.

    Attributes
    ----------
    now_s : monotonic time, s.
    rng : of lateness and of everything else that is drawn while the world runs.
    lateness : of the wake-ups of each process; idle where it is not named.
    """

    def __init__(self, seed: int) -> None:
        self.now_s = BEGIN_S
        self.rng = random.Random(seed)
        self.lateness: dict[str, Lateness] = {}
        self._main = getcurrent()
        self._due: list[tuple[float, int, Callable[[], Any] | tuple[Actor, int]]] = []
        self._order = itertools.count()
        self._paused_until_s: dict[str, float] = {}
        self._for_events: dict[Actor, threading.Event] = {}
        self._descriptors = select.epoll()
        self._for_descriptors: dict[int, Actor] = {}

    def close(self) -> None:
        """Close the descriptor of the hub."""
        self._descriptors.close()

    # --- for actors ------------------------------------------------------------------------------------

    def sleep_until(self, time_s: float) -> None:
        """Let the present actor wait until `time_s` (s), and as late as its process wakes up; or until `wake`."""
        actor = this_actor()
        if actor.killed:  # what Python unwinds may not wait
            raise GreenletExit
        if time_s < math.inf:
            self._push(max(time_s, self.now_s) + self._late_s(actor), (actor, actor.turn))
        self._main.switch()

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        """As of `Clock`: until the event is set, which other actors do."""
        if not event.is_set():
            actor = this_actor()
            self._for_events[actor] = event
            try:
                self.sleep_until(self.now_s + max(timeout_s, 0.0))
            finally:
                self._for_events.pop(actor, None)
        return event.is_set()

    def watch(self, descriptor: int) -> None:
        """Let actors wait for a descriptor from now on."""
        self._descriptors.register(descriptor, select.EPOLLIN)

    def forget(self, descriptor: int) -> None:
        """Watch a descriptor no longer."""
        self._descriptors.unregister(descriptor)

    def wait_for(self, descriptor: int, until_s: float) -> None:
        """Until a watched descriptor can be read, or `until_s` (s)."""
        self._for_descriptors[descriptor] = this_actor()
        try:
            self.sleep_until(until_s)
        finally:
            self._for_descriptors.pop(descriptor, None)

    def wake(self, actor: Actor | None) -> None:
        """End the wait of an actor, for bytes that have come."""
        if actor is not None and not actor.dead:
            actor.turn += 1
            self._push(self.now_s + self._late_s(actor), (actor, actor.turn))

    def _late_s(self, actor: Actor) -> float:
        return self.lateness.get(actor.group, usually_late)(self.rng)

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
        """Start an actor of a process; `run` must not raise."""

        def body() -> None:
            with suppress(GreenletExit):
                run()

        actor = Actor(body, group, self._main)
        self._push(self.now_s, (actor, actor.turn))
        return actor

    def kill(self, actor: Actor) -> None:
        """End an actor at once, as SIGKILL does: nothing of it runs any more but what Python itself unwinds."""
        actor.turn += 1
        actor.killed = True
        if actor and not actor.dead and actor is not getcurrent():
            actor.parent = getcurrent()  # where it returns to when it has ended
            actor.throw(GreenletExit)

    def pause(self, group: str, until_s: float) -> None:
        """Let no actor of a process run before `until_s` (s)."""
        self._paused_until_s[group] = until_s

    def run(self, duration_s: float) -> None:
        """Let `duration_s` (s) pass."""
        due, until_s = self._due, self.now_s + duration_s
        while due and due[0][0] <= until_s:
            time_s, _, what = heapq.heappop(due)
            if callable(what):
                self.now_s = max(self.now_s, time_s)
                what()
            else:
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
            self._wake_those_who_wait()
        self.now_s = until_s

    def _wake_those_who_wait(self) -> None:
        """For an event that has been set, or a descriptor that can be read."""
        for actor, event in list(self._for_events.items()):
            if event.is_set():
                del self._for_events[actor]
                self.wake(actor)
        for descriptor, _ in self._descriptors.poll(0):
            self.wake(self._for_descriptors.pop(descriptor, None))

    def _push(self, time_s: float, what: Callable[[], Any] | tuple[Actor, int]) -> None:
        heapq.heappush(self._due, (time_s, next(self._order), what))
