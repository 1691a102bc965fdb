"""What every fault of a world has: a beginning, a presence and an end."""

from __future__ import annotations

import math
from collections.abc import Callable
from weakref import WeakKeyDictionary

from tests.worlds.world import World

_PRESENT: WeakKeyDictionary[World, list[Fault]] = WeakKeyDictionary()


class Fault:
    """A fault of a world, present from its construction to its end.

    Attributes
    ----------
    began_s, ended_s : virtual time, s; `ended_s` is infinite while the fault is present.
    mendable : whether a person who looks at the machine ends it.
    targets : names of the gauges and lines that it affects; None for all of them, empty for none.
    """

    def __init__(
        self,
        world: World,
        undo: Callable[[], object] = lambda: None,
        lasts_s: float = math.inf,
        mendable: bool = False,
        targets: tuple[str, ...] | None = None,
    ) -> None:
        """undo : called once, at the end. lasts_s : after which it ends by itself, s."""
        self._hub = world.hub
        self._undo = undo
        self._beside = _PRESENT.setdefault(world, [])
        self._beside.append(self)
        self.mendable = mendable
        self.targets = targets
        self.began_s = self._hub.now_s
        self.ended_s = math.inf
        if math.isfinite(lasts_s):
            self._hub.at(self.began_s + lasts_s, self.end)

    @property
    def suspects(self) -> tuple[str, ...]:
        """Its targets; "" for all of them."""
        return ("",) if self.targets is None else self.targets

    @property
    def present(self) -> bool:
        return self.ended_s == math.inf

    def end(self) -> None:
        """End the fault now; does nothing after its end."""
        if self.present:
            self.ended_s = self._hub.now_s
            self._beside.remove(self)
            self._undo()


def present(world: World) -> list[Fault]:
    """Faults of a world that have not ended, oldest first."""
    return list(_PRESENT.get(world, []))


def mend(world: World) -> None:
    """End every fault that a person who looks at the machine can end."""
    for fault in present(world):
        if fault.mendable:
            fault.end()
