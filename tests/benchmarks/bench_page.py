"""What the page costs, and what it delivers: `python -m tests.benchmarks.bench_page`.

Side by side in one run: processor time of the page's process and of the daemon, and the cycles that the daemon missed,
without the page, with it, and with one and ten clients that read its events; the updates that Chromium received and
painted, of a hexapod whose page has more than 40 series; and the memory of the server over 72,000 events, which are an
hour of them, made without pauses.
"""

from __future__ import annotations

import asyncio
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

from compd.client import connect
from compd.page import Token
from compd.page.broadcast import LIVE_HZ, Broadcast
from compd.page.browsers import Browsers
from compd.page.recordings import Recordings
from compd.page.server import STATIC
from compd.setpoint_states import State
from tests.benchmarks.figures import quiet, show
from tests.benchmarks.limits import run_limited
from tests.support.event_stream import EventStream
from tests.support.hand_clock import HandClock
from tests.support.live_page import CHROMIUM, browser, opened, page_process, running_machine, served, until
from tests.support.scripted_page import LOOKS, ScriptedLink

MEASURED_S = 15.0
BROWSERS = (0, 1, 10)
EVENTS = 72_000
# Memory is looked at when so many of them have been made: before the last hour is full it grows, as it is meant to.
LOOKED_AT = (1, 18_000, 36_000, 54_000, EVENTS)
# For a browser's first event, s.
FIRST_EVENT_S = 30.0
# Of the event loop, in which every client takes an event.
_TURNS = 5
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int) -> float:
    """Processor time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def memory_mb(pid: int) -> float:
    """Resident memory of a process, MB."""
    return int(Path(f"/proc/{pid}/statm").read_text(encoding="utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


class Reader(threading.Thread):
    """A browser as far as the server can tell: it takes every event.

    events : the live ones that came. first : set when the first of them has come.
    """

    def __init__(self, address: str) -> None:
        super().__init__(daemon=True)
        self._stream = EventStream(address)
        self.events = 0
        self.first = threading.Event()
        self.start()

    def run(self) -> None:
        """Until the other end hangs up."""
        for event in self._stream:
            if event.name == "live":
                self.events += 1
                self.first.set()


def costs() -> None:
    """Of the page and of the daemon, a row for each number of clients."""
    rows: list[list[str]] = []
    base = 0.0
    with running_machine() as (directory, _), connect(directory / "compd.sock", timeout_s=30.0) as daemon:
        pids = [process["pid"] for process in daemon.status()["processes"].values()]

        def measured(name: str, page_pid: int, address: str, browsers: int) -> None:
            nonlocal base
            readers = [Reader(address) for _ in range(browsers)]
            for reader in readers:
                assert reader.first.wait(FIRST_EVENT_S), "no event came"

            def now() -> list[float]:
                loop = daemon.status()["loop"]
                missed = loop["missed_cycles"]
                own = cpu_s(page_pid) if page_pid else 0.0
                return [own, sum(map(cpu_s, pids)), missed, loop["cycles"], sum(reader.events for reader in readers)]

            before = now()
            time.sleep(MEASURED_S)  # the time over which is measured
            own_s, its_s, missed, cycles, events = (end - start for start, end in zip(before, now(), strict=True))
            base = base or its_s
            rate = f"{events / MEASURED_S / browsers:.1f}" if browsers else ""
            memory = f"{memory_mb(page_pid):.0f}" if page_pid else ""
            own = f"{100 * own_s / MEASURED_S:.1f}" if page_pid else ""
            loop = [f"{100 * its_s / MEASURED_S:.1f}", f"{its_s / base:.2f}", f"{missed:.0f} of {missed + cycles:.0f}"]
            rows.append([name, own, memory, rate, *loop])

        measured("no page", 0, "", 0)
        with page_process(directory / "compd.sock", directory / "recordings") as (address, pid):
            for browsers in BROWSERS:
                measured(f"page, {browsers} clients", pid, address, browsers)
    header = ["", "page, % of a core", "page, MB", "events/s each", "daemon, %", "ratio", "cycles missed"]
    load = os.getloadavg()[0]
    show(
        f"Load of the computer {load:.1f}. One daemon at 200 Hz; the page makes {LIVE_HZ:g} events a second",
        header,
        rows,
    )


def paints() -> None:
    """What one Chromium receives and paints of a hexapod."""
    if not CHROMIUM:
        print("Chromium is not there: what it paints is not measured")
        return
    counted = """async (measured_s) => {
      let [received, painted, frames] = [0, 0, 0];
      let [newest, ends] = [compd.live, false];
      const look = () => {
        frames += 1;
        if (compd.live !== newest) {
          newest = compd.live;
          painted += !compd.unpainted;
        }
        if (!ends) requestAnimationFrame(look);
      };
      const source = new EventSource('live');
      source.addEventListener('live', () => { received += 1; });
      await new Promise((resolve) => source.addEventListener('hello', resolve, { once: true }));
      requestAnimationFrame(look);
      const began_ms = performance.now();
      received = 0;
      await new Promise((resolve) => setTimeout(resolve, 1000 * measured_s));
      ends = true;
      source.close();
      const took_s = (performance.now() - began_ms) / 1000;
      return [received / took_s, painted / took_s, frames / took_s];
    }"""
    with served(name="hexapod.yaml") as page, browser() as chromium, opened(chromium, page) as tab:
        until(tab, "compd.live.setpoint?.correction_mm && compd.live.connected")
        series = tab.evaluate("compd.machine.wiring.length + compd.live.setpoint.correction_mm.length")
        received, painted, frames = tab.evaluate(counted, MEASURED_S)
        load = os.getloadavg()[0]
    row = [
        f"hexapod, {series} series",
        f"{received:.1f}",
        f"{painted:.1f}",
        f"{painted / LIVE_HZ:.2f}",
        f"{frames:.0f}",
    ]
    title = f"One Chromium without a graphics processor; load of the computer {load:.1f}"
    show(title, ["", "events/s received", "updates/s painted", "ratio to sent", "frames/s"], [row])


async def hour() -> list[list[str]]:
    """Memory of this process while an hour of events is made for ten clients, one of which reads nothing."""
    clock = HandClock()
    link = ScriptedLink("/no/socket")
    link.tell(State.OK, "")
    browsers = Browsers(clock)
    broadcast = Broadcast(link, browsers, Recordings(Path("/nowhere"), "/no/socket"))
    token = Token("a person", LOOKS, "")
    streams = [broadcast.events(browsers.connect(token, "127.0.0.1")) for _ in range(10)]
    await anext(streams[0])  # and it reads no more
    taken = [0] * len(streams[1:])
    readers = [asyncio.create_task(_read(stream, taken, k)) for k, stream in enumerate(streams[1:])]
    await asyncio.sleep(0)
    rows, base = [], 0.0
    for count in range(1, EVENTS + 1):
        clock.now_s = count / LIVE_HZ
        link.tell(State.OK, "", clock.now_s)
        await broadcast.make(clock.now_s, count % LIVE_HZ == 0)
        for _ in range(_TURNS):
            await asyncio.sleep(0)
        if count in LOOKED_AT:
            own_mb = memory_mb(os.getpid())
            base = base or own_mb
            rows.append([f"{count:,}", f"{own_mb:.1f}", f"{own_mb / base:.3f}"])
    for reader in readers:
        reader.cancel()
    await asyncio.gather(*readers, return_exceptions=True)
    print(f"of {EVENTS} events, made without pauses, each client that reads took {min(taken)} or more")
    return rows


async def _read(stream: Any, taken: list[int], k: int) -> None:
    async for event in stream:
        taken[k] += event.startswith(b"event: live")


def main() -> None:
    quiet()
    files = [path for path in STATIC.rglob("*") if path.suffix in (".html", ".css", ".js", ".svg")]
    print(f"a browser loads {sum(path.stat().st_size for path in files) / 1e3:.0f} kB, {len(files)} files")
    costs()
    paints()
    rows = asyncio.run(hour())
    show("Memory while events are made for ten clients, one of which reads none", ["events", "MB", "ratio"], rows)
    sys.stdout.flush()


if __name__ == "__main__":
    run_limited(main, MEASURED_S=0.5, BROWSERS=(1,), EVENTS=100, LOOKED_AT=(1, 100))
