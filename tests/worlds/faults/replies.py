"""Faults of replies on a line that stays open: lost, late, damaged, exchanged, old."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from tests.worlds.faults.fault import Fault
from tests.worlds.faults.layers import disturb
from tests.worlds.faults.wiring import names_on
from tests.worlds.world import World

Pieces = Sequence[tuple[float, bytes]]
# Bytes of a Modbus TCP reply that repeat the request's transaction, and names of lines that have them.
_TRANSACTION, _WITH_TRANSACTION = 2, "modbus_tcp"


def lost(world: World, target: str, count: int) -> Fault:
    """The next `count` replies of the line `target` are lost."""
    return _next(world, target, count, lambda reply: [])


def silent(world: World, target: str, lasts_s: float) -> Fault:
    """The devices on the line `target` answer nothing for `lasts_s` (s)."""
    return _while(world, target, lasts_s, lambda reply: [])


def late(world: World, target: str, count: int, by_s: float) -> Fault:
    """The next `count` replies of the line `target` come later by `by_s` (s)."""
    return _next(world, target, count, lambda reply: [(by_s, reply)])


def damaged(world: World, target: str, share: float, lasts_s: float) -> Fault:
    """A `share` of the replies of the line `target` has one wrong bit, for `lasts_s` (s)."""
    rng = world.hub.rng

    def damage(reply: bytes) -> Pieces:
        if not reply or rng.random() >= share:
            return [(0.0, reply)]
        damaged = bytearray(reply)
        damaged[rng.randrange(len(damaged))] ^= 1 << rng.randrange(7)
        return [(0.0, bytes(damaged))]

    return _while(world, target, lasts_s, damage)


def old(world: World, target: str, behind: int, lasts_s: float) -> Fault:
    """The line `target` answers with the reply from `behind` polls ago for `lasts_s` (s), as a gateway's cache does."""
    past: deque[bytes] = deque(maxlen=behind + 1)
    named = world.configuration.lines[target].kind == _WITH_TRANSACTION

    def repeat(reply: bytes) -> Pieces:
        past.append(reply)
        before = past[0]
        return [(0.0, reply[:_TRANSACTION] + before[_TRANSACTION:] if named else before)]

    return _while(world, target, lasts_s, repeat)


def exchanged(world: World, target: str, other: str, lasts_s: float) -> Fault:
    """The lines `target` and `other` answer with each other's last reply for `lasts_s` (s)."""
    newest: dict[str, bytes] = {}

    def from_line(name: str, partner: str) -> Callable[[bytes], Pieces]:
        def answer(reply: bytes) -> Pieces:
            newest[name] = reply
            return [(0.0, newest[partner])] if partner in newest else []

        return answer

    removes = [
        disturb(world.wires[name], from_line(name, partner)) for name, partner in ((target, other), (other, target))
    ]
    return Fault(
        world,
        lambda: [remove() for remove in removes],
        lasts_s,
        targets=names_on(world, target, other),
    )


def _next(world: World, line: str, count: int, disturbance: Callable[[bytes], Pieces]) -> Fault:
    """Disturb the next `count` replies of a line."""
    left = count

    def counted(reply: bytes) -> Pieces:
        nonlocal left
        left -= 1
        if left <= 0:
            fault.end()
        return disturbance(reply)

    fault = Fault(world, disturb(world.wires[line], counted), targets=names_on(world, line))
    return fault


def _while(world: World, line: str, lasts_s: float, disturbance: Callable[[bytes], Pieces]) -> Fault:
    """Disturb the replies of a line for `lasts_s` (s)."""
    remove = disturb(world.wires[line], disturbance)
    return Fault(world, remove, lasts_s, targets=names_on(world, line))
