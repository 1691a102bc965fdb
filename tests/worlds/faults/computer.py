"""Faults of the computer: it pauses, wakes late, a process is killed, it restarts or reboots, its clock is set."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from tests.worlds.disk import FULL, READ_ONLY
from tests.worlds.faults.fault import Fault
from tests.worlds.faults.layers import delay, disturb
from tests.worlds.faults.machine import driven
from tests.worlds.hub import usually_late
from tests.worlds.wires import lost, whole
from tests.worlds.world import ACQUISITION, BOOT_S, LOOP, SERVICE, STOPPED_S, World

T = TypeVar("T")

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


def disk_full(world: World, target: str, lasts_s: float) -> Fault:
    """No file can be written for `lasts_s` (s)."""
    return _of_disk(world.system.disk.refuses, FULL, world, lasts_s)


def disk_read_only(world: World, target: str, lasts_s: float) -> Fault:
    """The disk is mounted for reading only for `lasts_s` (s), after an error."""
    return _of_disk(world.system.disk.refuses, READ_ONLY, world, lasts_s)


def disk_slow(world: World, target: str, by_s: float, lasts_s: float) -> Fault:
    """Every write takes `by_s` (s), for `lasts_s` (s)."""
    return _of_disk(world.system.disk.slow_s, by_s, world, lasts_s)


def torn_file(world: World, target: str, how: str) -> Fault:
    """The computer starts anew after a power cut, which has torn the file of its state that was written last."""
    world.reboot()
    states = sorted(Path(world.running.state.directory).glob("*.json"), key=lambda path: path.stat().st_mtime_ns)
    for path in states[-1:]:
        world.system.disk.tear(path, how)
    return Fault(world, lasts_s=0.0)


def _of_disk(faults: list[T], fault: T, world: World, lasts_s: float) -> Fault:
    faults.append(fault)
    return Fault(world, lambda: faults.remove(fault), lasts_s)


def clock_set(world: World, target: str, by_s: float) -> Fault:
    """The wall clock is set by `by_s` (s)."""
    world.set_clock(by_s)
    return Fault(world, lasts_s=0.0, targets=())


# --- for tests that need one moment ------------------------------------------------------------------------------


def keep_busy(world: World, stalls_every_s: float, late_share: float = 0.03, late_s: float = 8e-3) -> Fault:
    """Other programs compute: some polls are late, replies are lost now and then, and all lines stall for a moment."""
    hub = world.hub

    def lateness(rng: random.Random) -> float:
        return usually_late(rng) + (rng.uniform(0.0, late_s) if rng.random() < late_share else 0.0)

    def stall() -> None:
        if not fault.present:
            return
        hub.pause(ACQUISITION, hub.now_s + hub.rng.uniform(*STALL_S))
        hub.at(hub.now_s + hub.rng.expovariate(1.0 / stalls_every_s), stall)

    def end() -> None:
        del hub.lateness[ACQUISITION]
        for remove in removes:
            remove()

    hub.lateness[ACQUISITION] = lateness
    removes = [
        disturb(world.wires[line], lambda reply: lost(reply) if hub.rng.random() < LOST_SHARE else whole(reply))
        for line in world.configuration.lines
    ]
    fault = Fault(world, end)
    hub.at(hub.now_s + hub.rng.expovariate(1.0 / stalls_every_s), stall)
    return fault
