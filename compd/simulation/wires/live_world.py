"""The world in real time: it moves at each access, and warms up and bends in steps."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from compd.clock import Clock
from compd.simulation.truth.world import World


class LiveWorld:
    """A world that follows a clock. Access is serialised by a lock.

    The scales show where the machine is when they are asked, as those of a machine that moves without steps do. All
    else changes little from one step to the next.
    """

    def __init__(self, world: World, clock: Clock) -> None:
        self._world = world
        self._clock = clock
        self._lock = threading.Lock()
        self._last_s = clock.monotonic()

    @contextmanager
    def now(self) -> Iterator[World]:
        """The world with its present motion, for exclusive use."""
        with self._lock:
            self._world.move(self._passed_s())
            yield self._world

    def step(self) -> None:
        """Warm up, bend and read every gauge."""
        with self._lock:
            self._world.advance(self._passed_s())

    def start(self) -> None:
        """Let time pass from now on."""
        self._last_s = self._clock.monotonic()

    @property
    def names(self) -> Sequence[str]:
        """Names of everything that can be sensed."""
        return self._world.names

    def sense(self, name: str) -> float:
        """Reading of a gauge, in its unit. Raises CompdError for a name that is not in `names`."""
        if not name.startswith("scale_"):
            return self._world.sense(name)
        with self.now() as world:
            return world.sense_scale(name)

    def _passed_s(self) -> float:
        """Seconds since the last access; called under the lock."""
        now_s = self._clock.monotonic()
        passed_s, self._last_s = now_s - self._last_s, now_s
        return passed_s
