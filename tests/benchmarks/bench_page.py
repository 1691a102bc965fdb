"""What the page costs: `python -m tests.benchmarks.bench_page`.

Processor time of the page's process and of the daemon, without a browser, with one and with ten that read the events,
side by side in one run, as shares of one processor and as ratios; and the size of what a browser loads.
"""

from __future__ import annotations

import http.client
import os
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

from compd.client import connect
from compd.page.server import STATIC
from tests.support.live_page import served

MEASURED_S = 20.0
BROWSERS = (0, 1, 10)
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int) -> float:
    """Processor time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS_PER_S


def memory_mb(pid: int) -> float:
    """Resident memory of a process, MB."""
    return int(Path(f"/proc/{pid}/statm").read_text(encoding="utf-8").split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


class Reader:
    """A browser as far as the server can tell: it takes every event. events, octets : that came."""

    def __init__(self, address: str) -> None:
        parts = urlsplit(address)
        self._connection = http.client.HTTPConnection(parts.netloc, timeout=30)
        self._connection.request("GET", f"/?{parts.query}")
        answer = self._connection.getresponse()
        answer.read()
        cookie = answer.headers["set-cookie"].partition(";")[0]
        self._connection.request("GET", "/live", headers={"Cookie": cookie})
        self._stream = self._connection.getresponse()
        self.events = self.octets = 0
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        while line := self._stream.readline():
            self.events += line.startswith(b"event: live")
            self.octets += len(line)

    def close(self) -> None:
        """Hang up."""
        if self._connection.sock is not None:
            self._connection.sock.close()


def main() -> None:
    files = [path for path in STATIC.rglob("*") if path.suffix in (".html", ".css", ".js", ".svg")]
    print(f"a browser loads {sum(path.stat().st_size for path in files) / 1e3:.0f} kB, {len(files)} files")
    with served() as page, connect(page.socket) as daemon:
        pids = [process["pid"] for process in daemon.status()["processes"].values()]
        base = None
        for browsers in BROWSERS:
            with ExitStack() as stack:
                readers = [Reader(page.address) for _ in range(browsers)]
                for reader in readers:
                    stack.callback(reader.close)
                time.sleep(1.0)
                before = cpu_s(page.pid), sum(map(cpu_s, pids)), sum(reader.events for reader in readers)
                time.sleep(MEASURED_S)
                after = cpu_s(page.pid), sum(map(cpu_s, pids)), sum(reader.events for reader in readers)
                own, its, events = (end - start for start, end in zip(before, after, strict=True))
            base = base or own
            rate = events / MEASURED_S / browsers if browsers else 0.0
            print(
                f"{browsers:2} browsers: page {100 * own / MEASURED_S:4.1f} % of a processor, x {own / base:.2f}; "
                f"daemon {100 * its / MEASURED_S:4.1f} %; {rate:.1f} events/s each; {memory_mb(page.pid):.0f} MB"
            )
    sys.stdout.flush()


if __name__ == "__main__":
    main()
