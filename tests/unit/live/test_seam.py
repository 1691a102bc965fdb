"""Time, waiting, ports, files, threads and processes come to the daemon through `System` and `Ports`, and only so."""

from __future__ import annotations

import selectors
import threading
from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import pytest

from compd.clock import MonotonicClock
from compd.gauge import LineFault, Quality
from compd.lines import Ports
from compd.live.daemon import Daemon
from compd.live.memory import Phase
from compd.live.system import Privileges, System
from compd.live.system.realtime import Permission
from tests.support.paths import ROOT
from tests.unit.live.seam_breaches import breaches
from tests.unit.live.test_daemon import configuration

# The seam itself.
SEAM = ("compd/live/system/*", "compd/lines/port.py")


class Exemption(NamedTuple):
    """A file that may use some names, and why."""

    path: str
    names: tuple[str, ...]
    reason: str


EXEMPTIONS = (
    Exemption("compd/clock.py", ("time.monotonic", ".wait()"), "System is a MonotonicClock"),
    Exemption("compd/lines/ports.py", ("compd.lines.port.*",), "Ports opens the ports of this computer"),
    Exemption(
        "compd/lines/*", ("compd.lines.ports.PORTS",), "a command that opens one line has the ports of this computer"
    ),
    Exemption("compd/lines/kinds/mqtt/subscriber.py", ("select.select", "time.time", ".read_text()"), "paho's socket"),
    Exemption(
        "compd/lines/kinds/opc_ua/*", ("asyncio.*", ".wait()", "time.time", ".read_*()"), "asyncua runs in asyncio"
    ),
    Exemption(
        "compd/lines/kinds/opc_ua/twin.py", ("threading.Thread", "socket.socket"), "the server of a simulated machine"
    ),
    Exemption("compd/live/run_daemon.py", ("*.THIS_COMPUTER",), "here `compd run` chooses its computer"),
    Exemption("compd/live/daemon.py", ("*.THIS_COMPUTER",), "the default of a daemon that is made but does not run"),
    Exemption("compd/live/supervisor.py", (".wait()",), "ChildProcess.wait waits in the system's selector"),
    Exemption("compd/live/service/listeners.py", ("socket.*", ".mkdir()"), "clients connect from outside"),
    Exemption("compd/live/service/request_context.py", ("compd.files.read_small_file",), "the clients' token"),
    Exemption("compd/live/service/model_switch.py", ("compd.files.read_descriptor",), "a client opened the file"),
    Exemption("compd/live/machine/model_loader.py", ("compd.files.read_small_file",), "a model that a person wrote"),
    Exemption("compd/live/record/*", ("compd.files.*", ".open()"), "a recording is written and read by a client"),
)


def product() -> Iterator[tuple[str, str]]:
    """Path and text of every file that must use the seam."""
    for place in ("compd/live", "compd/lines", "drivers", "compd/clock.py"):
        path = ROOT / place
        for file in [path] if path.is_file() else sorted(path.rglob("*.py")):
            name = str(file.relative_to(ROOT))
            if not any(fnmatch(name, pattern) for pattern in SEAM):
                yield name, file.read_text(encoding="utf-8")


def exempting(path: str, name: str) -> list[Exemption]:
    return [e for e in EXEMPTIONS if fnmatch(path, e.path) and any(fnmatch(name, pattern) for pattern in e.names)]


def test_the_product_uses_nothing_around_the_seam() -> None:
    around = [
        f"{path}:{line}: {name}"
        for path, text in product()
        for line, name in breaches(text)
        if not exempting(path, name)
    ]
    assert not around, "use compd.live.system.System:\n" + "\n".join(around)


def test_every_exemption_is_needed() -> None:
    found = [(path, name) for path, text in product() for _, name in breaches(text)]
    for exemption in EXEMPTIONS:
        for pattern in exemption.names:
            used = [name for path, name in found if fnmatch(path, exemption.path) and fnmatch(name, pattern)]
            assert used, f"{exemption.path} uses no {pattern}"


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("import time\ntime.sleep(1)", "time.sleep"),
        ("from time import monotonic as now\nnow()", "time.monotonic"),
        ("import time\ndef f(clock=time.monotonic): ...", "time.monotonic"),
        ("def f():\n    import time as t\n    return t.perf_counter_ns()", "time.perf_counter_ns"),
        ("from datetime import datetime\ndatetime.now()", "datetime.datetime.now"),
        ("import datetime as d\nd.datetime.utcnow()", "datetime.datetime.utcnow"),
        ("from datetime import date\ndate.today()", "datetime.date.today"),
        ("import select\nselect.select([1], [], [])", "select.select"),
        ("from select import poll\npoll()", "select.poll"),
        ("import selectors\nselectors.DefaultSelector()", "selectors.DefaultSelector"),
        ("import threading\nthreading.Thread(target=f).start()", "threading.Thread"),
        ("from threading import Timer\nTimer(1, f)", "threading.Timer"),
        ("import threading\nmake = threading.Condition", "threading.Condition"),
        ("import concurrent.futures\nconcurrent.futures.ThreadPoolExecutor()", "concurrent.futures.ThreadPoolExecutor"),
        ("self._stop.wait(1.0)", ".wait()"),
        ("threading.Event().wait()", ".wait()"),
        ("self._queue.get()", ".get()"),
        ("queue.get(timeout=1.0)", ".get()"),
        ("import os\nos.fork()", "os.fork"),
        ("from os import pidfd_open\npidfd_open(1)", "os.pidfd_open"),
        ("import os\nos.environ['SOURCE_DATE_EPOCH']", "os.environ"),
        ("import os\nos.environ.get('X')", "os.environ.get"),
        ("import subprocess\nsubprocess.run(['true'])", "subprocess.run"),
        ("import multiprocessing as m\nm.Process(target=f)", "multiprocessing.Process"),
        ("import asyncio\nasyncio.run(f())", "asyncio.run"),
        ("import ctypes\nctypes.CDLL(None)", "ctypes.CDLL"),
        ("import socket\nsocket.create_connection(('x', 1))", "socket.create_connection"),
        ("import serial\nserial.serial_for_url('loop://')", "serial.serial_for_url"),
        ("from compd.lines.port import TcpPort\nTcpPort('x', 1, 0.1)", "compd.lines.port.TcpPort"),
        ("import signal\nsignal.signal(signal.SIGTERM, f)", "signal.signal"),
        ("open('state.json')", "builtins.open"),
        ("path.open('rb')", ".open()"),
        ("path.open(encoding='utf-8')", ".open()"),
        ("Path('/proc/uptime').read_text().strip()", ".read_text()"),
        ("path.write_bytes(b'')", ".write_bytes()"),
        ("path.parent.mkdir(parents=True)", ".mkdir()"),
        ("from compd.files import write_files\nwrite_files({})", "compd.files.write_files"),
        ("from compd.live.system import THIS_COMPUTER\nTHIS_COMPUTER.monotonic()", "THIS_COMPUTER.monotonic"),
        ("from compd.clock import MonotonicClock\nMonotonicClock()", "compd.clock.MonotonicClock"),
    ],
)
def test_a_call_around_the_seam_is_found(source: str, name: str) -> None:
    assert [found.endswith(name) for _, found in breaches(source)] == [True]


@pytest.mark.parametrize(
    "source",
    [
        "self._clock.wait(self._stop, 1.0)\nself._system.monotonic()",
        "import threading\nlock, stop = threading.Lock(), threading.Event()",
        "import threading\nclass A:\n    thread: threading.Thread | None = None",
        "import selectors\ndef f(s: selectors.DefaultSelector) -> None:\n    s.register(1, selectors.EVENT_READ)",
        "from datetime import datetime\ndatetime.fromisoformat('2026-01-01')",
        "import signal\nsignal.Signals(9).name",
        "options.get('key')\nqueue.get_nowait()",
        "self._port.open()\nkind.open(settings, clock, ports)",
        "time = reading.time_s\ntime.hex()",
    ],
)
def test_what_stays_behind_the_seam_is_allowed(source: str) -> None:
    assert list(breaches(source)) == []


class NoPrivileges(Privileges):
    """A computer that grants nothing."""

    lock_memory = staticmethod(lambda: Permission(False, "no"))
    limit_wake_latency = staticmethod(lambda latency_us: Permission(False, "no"))
    use_fifo = staticmethod(lambda priority: Permission(False, "no"))
    sharpen_timers = shorten_switch_interval = end_with_any_thread = staticmethod(lambda: None)
    limit_memory = staticmethod(lambda memory_mb: None)
    rationed_priority = staticmethod(lambda *_: SimpleNamespace(look=lambda: None))
    quiet_collector = staticmethod(
        lambda: SimpleNamespace(start=lambda now_s: Permission(False, "no"), collect_if_due=lambda now_s: None)
    )


class NoPorts(Ports):
    """A computer to which nothing is connected."""

    def serial(self, *_: object) -> object:
        raise LineFault(Quality.LINE_LOST, "no such port in this world")

    tcp = serial


class OtherComputer(System):
    """A computer in another world: its time passes by waiting, and its disk is a dictionary."""

    ports = NoPorts()
    privileges = NoPrivileges()

    def __init__(self) -> None:
        self.now_s = 5e6
        self.files: dict[Path, object] = {}
        self.threads: list[str] = []
        self.selectors = 0
        self.looks = 0  #: waits of the test's own thread
        self.on_look: Callable[[], object] = lambda: None

    def monotonic(self) -> float:
        return self.now_s

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        self.now_s += timeout_s
        if threading.current_thread() is threading.main_thread():
            self.looks += 1
            self.on_look()
        return event.wait(1e-3)

    def sleep_until(self, time_s: float) -> None:
        self.now_s = max(self.now_s, time_s)

    def boot_id(self) -> str:
        return "its first start"

    def selector(self) -> selectors.BaseSelector:
        self.selectors += 1
        return selectors.DefaultSelector()

    def thread(self, run, name):
        self.threads.append(name)
        return threading.Thread(target=run, name=name, daemon=True)

    def read_file(self, path: Path, limit_bytes: int) -> bytes:
        if path not in self.files:
            raise FileNotFoundError(path)
        return self.files[path]

    def write_files(self, contents) -> None:
        self.files |= contents


def test_the_processes_of_a_daemon_use_the_computer_that_it_is_given(tmp_path, monkeypatch):
    computer, before = OtherComputer(), set(threading.enumerate())

    def refused(name, method):
        def ask(*arguments):
            if threading.current_thread() in before - {threading.main_thread()}:  # one that another test has left
                return method(*arguments)
            return pytest.fail(f"{name} of this computer was asked")

        return ask

    for name in set(vars(OtherComputer)) & set(dir(System)) - {"__init__", "__module__", "__doc__", "ports"}:
        owner = System if name in vars(System) else MonotonicClock
        if callable(vars(owner).get(name)) and not name.startswith("__"):
            monkeypatch.setattr(owner, name, refused(name, vars(owner)[name]))
    configured = configuration(tmp_path)
    daemon = Daemon(configured, system=computer)
    cycles = []

    def keeps_turn(number):
        cycles.append(computer.now_s)
        return len(cycles) < 5

    monkeypatch.setattr(daemon.control, "keeps_turn", keeps_turn)
    daemon.loop_process.run(1)
    assert computer.now_s == pytest.approx(5e6 + 4 * daemon.period_s), "cycles of its time"
    (acquisition,) = daemon.acquisition

    def on_look():
        lines = acquisition.status()
        if lines and all("detail" in line for line in lines.values()):  # its threads are real ones
            daemon.control.enter(Phase.STOPPING, "the end")

    computer.on_look = on_look
    acquisition.run()
    lines = acquisition.status()
    assert set(lines) == set(configured.lines)
    assert {line["detail"] for line in lines.values()} == {"no such port in this world"}
    daemon.service.run()
    assert computer.selectors >= 2, "of the log and of the publisher"
    assert {f"line {name}" for name in configured.lines} <= set(computer.threads)
    assert {"last readings", "log relay"} <= set(computer.threads)
    assert not (tmp_path / "state").exists()
    daemon.close()
