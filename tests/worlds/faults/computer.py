"""Faults of the computer: it pauses, wakes late, a process is killed, it restarts or reboots, its clock is set."""

from __future__ import annotations

import random
from collections.abc import Sequence

from tests.worlds.faults.fault import Fault
from tests.worlds.faults.layers import delay
from tests.worlds.faults.machine import driven
from tests.worlds.hub import usually_late
from tests.worlds.wires import whole
from tests.worlds.world import ACQUISITION, BOOT_S, LOOP, SERVICE, STOPPED_S, World

PROCESSES = (ACQUISITION, LOOP, SERVICE)
# Of a busy computer: how long it stalls, s, and share of the replies that are lost.
STALL_S = (0.02, 0.3)
LOST_SHARE = 1e-4


def pause(world: World, target: str, lasts_s: float) -> Fault:
    """No process of the daemon runs for `lasts_s` (s)."""
    world.pause(lasts_s)
    return Fault(world, lasts_s=lasts_s, targets=())


def pause_in_motion(
    world: World, target: str, to_mm: Sequence[float], mm_per_s: float, mm_per_s2: float, after_s: float, lasts_s: float
) -> Fault:
    """The links drive, as in `machine.driven`; `after_s` (s) later no process of the daemon runs for `lasts_s` (s)."""
    driven(world, target, to_mm, mm_per_s, mm_per_s2)
    world.hub.at(world.hub.now_s + after_s, lambda: world.pause(lasts_s))
    return Fault(world, lasts_s=after_s + lasts_s, targets=())


def pause_process(world: World, target: str, lasts_s: float) -> Fault:
    """The process `target` does not run for `lasts_s` (s)."""
    world.hub.pause(target, world.hub.now_s + lasts_s)
    return Fault(world, lasts_s=lasts_s, targets=())


def wakes_late(world: World, target: str, share: float, by_s: float, lasts_s: float) -> Fault:
    """A `share` of the wake-ups of the process `target` is late by up to `by_s` (s), for `lasts_s` (s)."""

    def late(rng: random.Random) -> float:
        return rng.uniform(0.0, by_s) if rng.random() < share else 0.0

    return Fault(world, delay(world.hub, target, late), lasts_s, targets=())


def killed(world: World, target: str) -> Fault:
    """The process `target` is killed; the supervisor starts it again."""
    world.kill(target)
    return Fault(world, lasts_s=0.0)


def restart(world: World, target: str) -> Fault:
    """The daemon stops and starts."""
    world.restart()
    return Fault(world, lasts_s=STOPPED_S)


def reboot(world: World, target: str) -> Fault:
    """The computer starts anew."""
    world.reboot()
    return Fault(world, lasts_s=BOOT_S)


def clock_set(world: World, target: str, by_s: float) -> Fault:
    """The wall clock is set by `by_s` (s)."""
    world.set_clock(by_s)
    return Fault(world, lasts_s=0.0, targets=())


# --- for tests that need one moment ------------------------------------------------------------------------------


def keep_busy(world: World, stalls_every_s: float, late_share: float = 0.03, late_s: float = 8e-3) -> None:
    """Other programs compute: some polls are late, replies are lost now and then, and all lines stall for a moment."""
    hub = world.hub

    def lateness(rng: random.Random) -> float:
        return usually_late(rng) + (rng.uniform(0.0, late_s) if rng.random() < late_share else 0.0)

    def stall() -> None:
        hub.pause(ACQUISITION, hub.now_s + hub.rng.uniform(*STALL_S))
        hub.at(hub.now_s + hub.rng.expovariate(1.0 / stalls_every_s), stall)

    hub.lateness[ACQUISITION] = lateness
    for line in world.configuration.lines:
        world.wires[line].fault = lambda reply: [] if hub.rng.random() < LOST_SHARE else whole(reply)
    hub.at(hub.now_s + hub.rng.expovariate(1.0 / stalls_every_s), stall)
