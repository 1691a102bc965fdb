"""A computer in virtual time: the seam of the product, `compd.live.system.System`, on a hub.

Its threads and processes are actors. Descriptors (event descriptors, pipes, Unix sockets) are the kernel's own, within
this process; only the waiting for them is virtual. Files are real ones in a directory of the world.
"""

from __future__ import annotations

import os
import selectors
import socket
import threading
import traceback
import uuid
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from compd.files import Content
from compd.live.system import ForkedProcess, Privileges, System
from compd.live.system.realtime import Permission
from tests.worlds.disk import Disk
from tests.worlds.hub import Actor, Hub, this_actor
from tests.worlds.wires import VirtualPorts

_CALENDAR = datetime(2026, 1, 1, tzinfo=UTC)
# A process that another configuration is tried in, s.
_CHECKED_AFTER_S = 0.3
KILLED = -9
# What a world cannot grant: it has the priorities of its own hub.
_NOT_HERE = Permission(False, "a computer in virtual time")


class NoPriority:
    """In the place of `RationedPriority`."""

    def __init__(self, *_: Any) -> None:
        self.has_priority = False

    def look(self) -> None:
        """Nothing."""


class NoCollector:
    """In the place of `QuietCollector`."""

    def start(self, _now_s: float) -> Permission:
        return _NOT_HERE

    def collect_if_due(self, _now_s: float) -> None:
        """Nothing."""


class NoPrivileges(Privileges):
    """What the processes ask for, none of which is granted."""

    sharpen_timers = staticmethod(lambda: None)
    use_fifo = staticmethod(lambda _priority: _NOT_HERE)
    lock_memory = staticmethod(lambda: _NOT_HERE)
    limit_wake_latency = staticmethod(lambda _us: _NOT_HERE)
    limit_memory = staticmethod(lambda _mb: None)
    shorten_switch_interval = staticmethod(lambda: None)
    end_with_any_thread = staticmethod(lambda: None)
    rationed_priority = NoPriority  # type: ignore[assignment]
    quiet_collector = NoCollector  # type: ignore[assignment]


class VirtualSelector(selectors.EpollSelector):
    """Waits in virtual time for descriptors of this process."""

    def __init__(self, hub: Hub) -> None:
        super().__init__()
        self._hub = hub
        self.closed = False
        hub.watch(self.fileno())

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        until_s = float("inf") if timeout is None else self._hub.now_s + max(timeout, 0.0)
        ready = super().select(0)
        if not ready and until_s > self._hub.now_s:
            self._hub.wait_for(self.fileno(), until_s)
            ready = super().select(0)
        return ready

    def cut_connections(self) -> None:
        """Close the connections that it waits for, as the kernel does for a process that has gone; listeners stay."""
        ends = [] if self.closed else [key.fileobj for key in self.get_map().values()]
        self.close()
        for end in ends:
            if isinstance(end, socket.socket) and not end.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                with suppress(OSError), end:
                    end.shutdown(socket.SHUT_RDWR)
                end.close()

    def close(self) -> None:
        if self.closed:
            return
        self.closed = True
        self._hub.forget(self.fileno())
        super().close()


class VirtualThread(threading.Thread):
    """A thread that is an actor of the process that starts it."""

    def __init__(self, system: VirtualSystem, run: Callable[[], object], name: str) -> None:
        super().__init__(target=run, name=name, daemon=True)
        self._system = system
        self._run_it = run
        self._actor: Actor | None = None

    def start(self) -> None:
        process = self._system.process_of(this_actor())
        self._actor = process.spawn(self._run_it)

    def join(self, timeout: float | None = None) -> None:
        hub = self._system.hub
        until_s = float("inf") if timeout is None else hub.now_s + timeout
        while self.is_alive() and hub.now_s < until_s:
            hub.sleep_until(min(until_s, hub.now_s + 0.01))

    def is_alive(self) -> bool:
        return self._actor is not None and not self._actor.dead

    @property
    def ident(self) -> int | None:
        return None if self._actor is None else id(self._actor)

    @property
    def native_id(self) -> int | None:  # type: ignore[override]
        return self.ident


class VirtualProcess(ForkedProcess):
    """A process whose threads are actors; it ends with its first one, or with an exception in any."""

    def __init__(self, system: VirtualSystem, run: Callable[[], object], name: str, pid: int) -> None:
        self.pid = pid
        self.name = name
        self.descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._system = system
        self._actors: list[Actor] = []
        self.selectors: list[VirtualSelector] = []
        self._exit_code: int | None = None
        self.spawn(lambda: self._end(self._main(run)))

    @property
    def is_debugged(self) -> bool:
        return False

    @property
    def running(self) -> bool:
        return self._exit_code is None

    def spawn(self, run: Callable[[], object]) -> Actor:
        """Start another thread of it."""

        def thread() -> None:
            try:
                run()
            except Exception:  # noqa: BLE001  as `Privileges.end_with_any_thread`: it ends with any of its threads
                self._system.tracebacks.append(traceback.format_exc())
                self._end(1)

        actor = self._system.hub.spawn(thread, self.name)
        self._system.owner[actor] = self
        self._actors.append(actor)
        return actor

    def _main(self, run: Callable[[], object]) -> int:
        try:
            run()
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else 1
        return 0

    def exit_code(self) -> int | None:
        if self._exit_code is not None:
            os.close(self.descriptor)
        return self._exit_code

    def kill(self) -> None:
        self._end(KILLED)

    def _end(self, code: int) -> None:
        if self._exit_code is not None:
            return
        self._exit_code = code
        for actor in self._actors:
            self._system.owner.pop(actor, None)
            self._system.hub.kill(actor)
        for selector in self.selectors:
            selector.cut_connections()
        os.eventfd_write(self.descriptor, 1)


class VirtualSystem(System):
    """A computer on a hub.

    Attributes
    ----------
    owner : the process of each actor. processes : those that run, by name. tracebacks : of exceptions that ended one.
    calendar_s : by how much the calendar's clock was set, s. disk : on which files are written.
    """

    def __init__(self, hub: Hub, ports: VirtualPorts) -> None:
        self.hub = hub
        self.ports = ports
        self.privileges = NoPrivileges()
        self.owner: dict[Actor, VirtualProcess] = {}
        self.processes: dict[str, VirtualProcess] = {}
        self.tracebacks: list[str] = []
        self.calendar_s = 0.0
        self.disk = Disk(hub)
        self.boot()

    def boot(self) -> None:
        """Another start of the computer."""
        self._boot_id = str(uuid.UUID(int=self.hub.rng.getrandbits(128)))
        self._signals = -1

    # --- time ------------------------------------------------------------------------------------------

    def monotonic(self) -> float:
        return self.hub.now_s

    def utc(self) -> datetime:
        return _CALENDAR + timedelta(seconds=self.hub.now_s + self.calendar_s)

    def boot_id(self) -> str:
        return self._boot_id

    def sleep_until(self, time_s: float) -> None:
        self.hub.sleep_until(time_s)

    def wait(self, event: threading.Event, timeout_s: float) -> bool:
        return self.hub.wait(event, timeout_s)

    def selector(self) -> selectors.BaseSelector:
        selector = VirtualSelector(self.hub)
        process = self.process_of(this_actor())
        process.selectors = [*(one for one in process.selectors if not one.closed), selector]
        return selector

    # --- threads and processes -------------------------------------------------------------------------

    def process_of(self, actor: Actor) -> VirtualProcess:
        """The process to which an actor belongs."""
        return self.owner[actor]

    def start(self, run: Callable[[], object], name: str) -> VirtualProcess:
        """Start a process that no other one waits for: the supervisor's, a client's."""
        process = self.processes[name] = VirtualProcess(self, run, name, 1000 + len(self.owner))
        self.hub.pause(name, 0.0)  # the one of that name before it may have been stopped
        return process

    def thread(self, run: Callable[[], object], name: str) -> threading.Thread:
        return VirtualThread(self, run, name)

    def fork(self, run: Callable[[], None], name: str, output: int | None, keeps_sockets: bool) -> ForkedProcess:
        """An actor; but a configuration is tried in a real process, as everything that it makes ends with that."""
        if name != "check":
            return self.start(run, name)
        pid = os.fork()
        if pid == 0:
            code = 1
            try:
                run()
                code = 0
            except SystemExit as end:
                code = end.code if isinstance(end.code, int) else 1
            finally:
                os._exit(code)
        _, status = os.waitpid(pid, 0)
        code = os.waitstatus_to_exitcode(status)

        def ended() -> None:
            self.hub.sleep_until(self.hub.now_s + _CHECKED_AFTER_S)
            raise SystemExit(code)

        return self.start(ended, name)

    @contextmanager
    def signals(self) -> Iterator[int]:
        reading, writing = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._signals = writing
        try:
            yield reading
        finally:
            os.close(reading)
            os.close(writing)
            if self._signals == writing:
                self._signals = -1

    def send_signal(self, number: int) -> None:
        """To the supervisor, where one runs."""
        if self._signals >= 0:
            os.write(self._signals, bytes([number]))

    # --- files -----------------------------------------------------------------------------------------

    def write_files(self, contents: Mapping[Path, Content]) -> None:
        self.disk.write()
        super().write_files(contents)
        self.disk.torn -= {path.name for path in contents}

    def rename(self, path: Path, new: Path) -> None:
        self.disk.rename()
        super().rename(path, new)
