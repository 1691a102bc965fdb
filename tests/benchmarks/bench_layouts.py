"""How late the loop wakes, and when a client has its setpoint, in three layouts of processes that take turns.

`python -m tests.benchmarks.bench_layouts`; with `--load` two busy processes run beside, and with `--schedules` ways to
schedule service and client take turns instead. The layouts are prototypes around the daemon's cycle; cyclictest, from
rt-tests, runs beside the loop and once alone.
"""

from __future__ import annotations

import argparse
import gc
import json
import marshal
import math
import mmap
import multiprocessing
import os
import queue
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from compd.compensation import Compensation
from compd.compensation.values import Contributions
from compd.gauge import Quality, Reading, bad, good
from compd.live.loop import CycleInputs, CycleState, Setpoint, step
from compd.live.memory import Readings, Snapshot
from compd.live.system import realtime
from compd.model.kinematics import Frame
from compd.operation_settings import LoopSettings
from compd.setpoint_states import Mode, State
from tests.benchmarks.bench_loop import PRIORITY, BusyDrivers, load_beside
from tests.benchmarks.figures import quiet, show
from tests.benchmarks.limits import BEGINS_WITHIN_S, run_limited
from tests.support.live_machine import machine

RATES_HZ = (200, 1000)
TOGETHER, TWO, THREE = "one process", "loop | acquisition + service", "loop | acquisition | service"
NO_LOOP = "cyclictest and drivers alone"
# Layout, and how service and client are scheduled.
SCHEDULES = {
    "ordinary": (THREE, "ordinary", "ordinary"),
    "service nice -10": (THREE, "nice -10", "ordinary"),
    "service FIFO 1": (THREE, "FIFO 1", "ordinary"),
    "service and client FIFO 1": (THREE, "FIFO 1", "FIFO 1"),
    "the same, service beside acquisition": (TWO, "FIFO 1", "FIFO 1"),
}
PERCENTILES = (50, 99, 99.9)
LOAD_PROCESSES = 2
SECONDS, ROUNDS = 8.0, 5
SETTLE_S = 1.5
WARM_UP_CYCLES = 200
HISTOGRAM_US = 20_000
RING_SLOTS, RING_SLOT_BYTES = 512, 1024
# What a client is sent of a setpoint's values, and of their frame.
VECTORS = ("tip_M_mm", "tip_B0_mm", "tip_P_mm", "link_length_mm", "scale_setpoint_mm", "correction_mm")
FRAME_VECTORS = ("origin_M_mm", "displacement_M_mm", "rotation_M_rad")
# Version, value, time, version: where the two versions differ, the slot is being written.
SLOT = struct.Struct("QddQ")
FORK = multiprocessing.get_context("fork")
MEASURED = machine()

# Percentiles in us, or one count, by name.
Figures = dict[str, list[float]]


class LatestReadings:
    """The newest reading of each channel, in the memory of one process."""

    def __init__(self) -> None:
        self.channels = MEASURED.latest.channels
        self.known: list[Reading] = [bad(0.0, Quality.NEVER_READ)] * len(self.channels)

    def put(self, index: int, reading: Reading) -> None:
        self.known[index] = reading

    def snapshot(self, time_s: float) -> Snapshot:
        return Snapshot(time_s, Readings.of(self.known))


class SharedReadings(LatestReadings):
    """The same in memory that processes share. A reader waits for no writer."""

    def __init__(self) -> None:
        super().__init__()
        self._memory = mmap.mmap(-1, len(self.channels) * SLOT.size)
        self._versions = [0] * len(self.channels)

    def put(self, index: int, reading: Reading) -> None:
        version = self._versions[index] = self._versions[index] + 1
        SLOT.pack_into(self._memory, index * SLOT.size, version, reading.value, reading.time_s, version)

    def snapshot(self, time_s: float) -> Snapshot:
        """A slot that is being written keeps the reading known before: its writer may be waiting for this very
        processor. `pack_into` fills a slot with zeros first, so that version 0 is none."""
        first, second = self._memory[:], self._memory[:]
        for i, (slot, again) in enumerate(zip(SLOT.iter_unpack(first), SLOT.iter_unpack(second), strict=True)):
            if slot == again and slot[0] == slot[3] != 0:
                self.known[i] = good(slot[1], slot[2])
        return super().snapshot(time_s)


class Ring:
    """Setpoints from process to process, in shared memory, with the methods of a queue."""

    def __init__(self) -> None:
        self._wake = os.eventfd(0)
        self._slots = mmap.mmap(-1, RING_SLOTS * RING_SLOT_BYTES)
        self._count = memoryview(mmap.mmap(-1, mmap.PAGESIZE)).cast("Q")
        self._taken = 0

    def put(self, setpoint: Setpoint | None) -> None:
        data = marshal.dumps(setpoint and flat(setpoint))
        start = self._count[0] % RING_SLOTS * RING_SLOT_BYTES
        self._slots[start : start + len(data)] = data
        self._count[0] += 1
        os.eventfd_write(self._wake, 1)

    def get(self) -> Setpoint | None:
        while self._taken == self._count[0]:
            os.eventfd_read(self._wake)
        start = self._taken % RING_SLOTS * RING_SLOT_BYTES
        self._taken += 1
        found = marshal.loads(self._slots[start : start + RING_SLOT_BYTES])
        return found and unflat(*found)


def flat(setpoint: Setpoint) -> tuple[Any, ...]:
    """For marshal, which takes a sixth of the time that pickle takes; without what the setpoint was computed from."""
    values = setpoint.values
    assert values is not None
    names = (setpoint.state.value, setpoint.reason, setpoint.mode.value, setpoint.model)
    vectors = {name: getattr(values, name).tobytes() for name in VECTORS}
    frame = {name: getattr(values.frame, name).tobytes() for name in FRAME_VECTORS}
    contributions = {name: part.tobytes() for name, part in values.contributions.items()}
    return setpoint[:4], names, vectors, frame, contributions, setpoint.u_tip_um


def unflat(head: Any, names: Any, vectors: Any, frame: Any, contributions: Any, u_tip_um: Any) -> Setpoint:
    arrays, of_frame, parts = (
        {name: np.frombuffer(data) for name, data in by_name.items()} for by_name in (vectors, frame, contributions)
    )
    absent = np.zeros(0)
    values = Compensation(
        **dict.fromkeys(Compensation._fields, absent)
        | arrays
        | {"frame": Frame(**dict.fromkeys(Frame._fields, absent) | of_frame)}
        | {"contributions": Contributions(tuple(parts), np.array(list(parts.values()))), "own_columns": ()}
    )
    return Setpoint(*head, State(names[0]), names[1], Mode(names[2]), values, names[3], u_tip_um=u_tip_um)


def fork(function: Callable[[], Figures]) -> Callable[[], Figures]:
    """Call it in a process of its own; what is returned waits for its figures."""
    near, far = FORK.Pipe(duplex=False)
    FORK.Process(target=lambda: far.send(function()), daemon=True).start()
    far.close()
    return near.recv


def run_loop(latest: Any, put: Callable[[Setpoint | None], None], rate_hz: float, seconds: float, go: Any) -> Figures:
    """The daemon's cycle at absolute times, from `go` on."""
    settings = LoopSettings(rate_hz=rate_hz, stale_after_s=1, on_stale="hold", hold_s=1, priority=PRIORITY)
    cycle, commands = replace(MEASURED.settings, loop=settings), MEASURED.commands
    state = CycleState.at_start(cycle.model)

    def run_cycle(tick: int, now_s: float) -> Setpoint:
        nonlocal state
        inputs = CycleInputs(tick, latest.snapshot(now_s), commands.zero, commands.target, commands.models)
        setpoint, state = step(state, inputs, cycle)
        return setpoint

    realtime.sharpen_timers()
    for permission in (realtime.use_fifo(PRIORITY), realtime.lock_memory()):
        assert permission.granted, permission.detail
    collector = realtime.QuietCollector()
    collector.start(time.monotonic())
    while not all(reading.ok for reading in latest.snapshot(0.0).readings):
        time.sleep(0.01)  # readings are in shared memory, which tells nobody of a new one
    for _ in range(WARM_UP_CYCLES):
        run_cycle(0, time.monotonic())
    go.wait()
    lateness_s, cost_s, missed, tick = [], [], 0, 1
    origin_s, period_s = time.monotonic(), 1 / rate_hz
    while tick <= seconds * rate_hz:
        wake_s = origin_s + tick * period_s
        realtime.sleep_until(wake_s)
        start_s = time.monotonic()
        setpoint = run_cycle(tick, start_s)
        if setpoint.valid:
            put(setpoint)
        end_s = time.monotonic()
        lateness_s.append(start_s - wake_s)
        cost_s.append(end_s - start_s)
        next_tick = max(tick + 1, math.ceil((end_s - origin_s) / period_s))
        missed += next_tick - tick - setpoint.valid
        tick = next_tick
        collector.collect_if_due(end_s)
    put(None)
    return {"wake-up": percentiles(lateness_s), "end of the cycle": percentiles(cost_s), "missed or invalid": [missed]}


def acquire(latest: Any, meanwhile: Callable[[], Figures]) -> Figures:
    """The drivers, for as long as something else takes; its figures, and how often the drivers asked."""
    realtime.shorten_switch_interval()
    drivers = BusyDrivers(None, None, latest, None)
    drivers.start()
    start_s = time.monotonic()
    figures = meanwhile()
    polls = drivers.status()["busy"]["polls"]
    threading.excepthook = lambda _: None  # a driver's thread ends with its line
    drivers.stop(0)
    return figures | {"polls per second": [polls / (time.monotonic() - start_s)]}


def serve(get: Callable[[], Setpoint | None], client: socket.socket, scheduling: str) -> Figures:
    """Encode and send every setpoint; the time from its tick until it can be sent."""
    schedule(scheduling)
    encoded_s = []
    for setpoint in iter(get, None):
        data = setpoint.to_json()
        encoded_s.append(time.monotonic() - setpoint.time_s)
        client.sendall(data)
    client.shutdown(socket.SHUT_WR)
    return {"encoded": percentiles(encoded_s)}


def receive(service: socket.socket, scheduling: str) -> Figures:
    """The client: the time from each setpoint's tick until it has been read."""
    schedule(scheduling)
    with service.makefile("rb") as lines:
        return {"at the client": percentiles([-json.loads(line)["time_s"] + time.monotonic() for line in lines])}


def schedule(scheduling: str) -> None:
    """Of the calling thread."""
    if scheduling == "FIFO 1":
        assert realtime.use_fifo(1).granted
    elif scheduling == "nice -10":
        os.setpriority(os.PRIO_PROCESS, 0, -10)


def run_together(client: socket.socket, rate_hz: float, seconds: float, go: Any) -> Figures:
    """Drivers and service are threads beside the loop."""
    setpoints: queue.SimpleQueue[Setpoint | None] = queue.SimpleQueue()
    served: Figures = {}
    service = threading.Thread(target=lambda: served.update(serve(setpoints.get, client, "ordinary")), daemon=True)
    service.start()
    latest = LatestReadings()
    figures = acquire(latest, lambda: run_loop(latest, setpoints.put, rate_hz, seconds, go))
    service.join()
    return figures | served


def run_layout(layout: str, scheduling: str, scheduling_client: str, rate_hz: float, seconds: float) -> Figures:
    """The figures of one run."""
    go, done = FORK.Barrier(2, timeout=BEGINS_WITHIN_S), FORK.Event()

    def wait() -> Figures:
        done.wait()
        return {}

    latest, ring, (client, service) = SharedReadings(), Ring(), socket.socketpair()
    loop = partial(run_loop, latest, ring.put, rate_hz, seconds, go)
    serve_ring = partial(serve, ring.get, client, scheduling)
    processes = {
        TOGETHER: [partial(run_together, client, rate_hz, seconds, go)],
        TWO: [loop, partial(acquire, latest, serve_ring)],
        THREE: [loop, partial(acquire, latest, wait), serve_ring],
        NO_LOOP: [partial(acquire, latest, wait)],
    }[layout]
    if layout != NO_LOOP:
        processes.append(partial(receive, service, scheduling_client))
    results = [fork(process) for process in processes]
    time.sleep(SETTLE_S)  # what the interpreters do after their start is not measured
    if layout != NO_LOOP:
        go.wait()
    command = ["cyclictest", "--quiet", "--mlockall", f"--priority={PRIORITY}", f"--interval={round(1e6 / rate_hz)}"]
    command += [f"--loops={round(seconds * rate_hz)}", f"--histogram={HISTOGRAM_US}"]
    output = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    done.set()
    figures: Figures = {}
    for result in results:
        figures |= result()
    client.close()
    service.close()
    bins = np.array(re.findall(r"(?m)^(\d{6}) (\d+)$", output), dtype=int)
    return figures | {"cyclictest": percentiles(np.repeat(bins[:, 0], bins[:, 1]) * 1e-6)}


def percentiles(durations_s: Any) -> list[float]:
    """In us."""
    return list(np.percentile(durations_s, PERCENTILES) * 1e6)


def compare(variants: dict[str, Callable[[], Figures]], rounds: int, title: str) -> None:
    """The variants take turns; each figure's median over the rounds."""
    runs = defaultdict(list)
    for _ in range(rounds):
        for variant, run in variants.items():
            figures = run()
            runs[variant].append(figures)
            parts = [f"{name} {' '.join(f'{x:.0f}' for x in figure)}" for name, figure in figures.items()]
            print(f"{title}; {variant}: {'; '.join(parts)}", flush=True)
    rows = []
    for variant, of_variant in runs.items():
        medians = {name: np.median([run[name] for run in of_variant], axis=0) for name in of_variant[0]}
        rows.append([variant] + [""] * 6)
        for name, median in medians.items():
            ratios = [f"{ratio:.1f}" for ratio in median / medians["cyclictest"]] if name == "wake-up" else []
            row = [f"  {name}", *(f"{x:.0f}" for x in median), *ratios]
            rows.append(row + [""] * (7 - len(row)))
    header = ["us; wake-up beside cyclictest", "50 %", "99 %", "99.9 %", "ratio, 50 %", "99 %", "99.9 %"]
    show(f"{title}, medians of {rounds} runs", header, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--load", action="store_true", help=f"{LOAD_PROCESSES} busy processes beside")
    parser.add_argument("--schedules", action="store_true", help="compare how service and client are scheduled")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each run")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    options = parser.parse_args()
    quiet()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # no loop with priority is left behind
    gc.freeze()  # a collection would copy the pages that the processes share
    with load_beside(LOAD_PROCESSES if options.load else 0):
        for rate_hz in RATES_HZ:
            layouts = {layout: (layout, "ordinary", "ordinary") for layout in (TOGETHER, TWO, THREE, NO_LOOP)}
            variants = {
                name: partial(run_layout, *variant, rate_hz, options.seconds)
                for name, variant in (SCHEDULES if options.schedules else layouts).items()
            }
            title = f"{rate_hz} Hz, {options.seconds:g} s, {'with' if options.load else 'without'} load"
            compare(variants, options.rounds, title)


if __name__ == "__main__":
    run_limited(main, RATES_HZ=(200,), SECONDS=0.5, ROUNDS=1)
