"""The machine of the matrix in virtual time: a world of `tests.worlds`, with a fault on any of its lines."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

import yaml

from compd.configuration import Configuration
from compd.errors import DaemonError
from compd.live.loop import Setpoint
from compd.simulation import Cause, CauseSizer, parse_hidden
from compd.simulation.truth.strengths import FULLY_MEASURED, Strengths, seen_by
from tests.injection.faults import Exchange, Fault
from tests.injection.line_faults import FaultOfLine, sent_through
from tests.injection.machine import (
    SEED,
    SETTLED_S,
    TRIPOD,
    UNKNOWN,
    Held,
    Machine,
    exchange_ports,
    prepare,
)
from tests.injection.replies import protocol_of
from tests.support.live_models import file_with
from tests.support.paths import CONFIG
from tests.support.watching import Message, Rules, Seen, broken_rules
from tests.worlds.connection import Connection
from tests.worlds.faults.computer import keep_busy
from tests.worlds.world import SUPERVISOR, Told, World, built

# Steel.
EXPANSION, EXPANSION_PPM_PER_K = "link_expansion", 11.5
# How long the daemon has to end, and a person's request to be answered, s.
ENDS_WITHIN_S, ANSWERED_WITHIN_S = 10.0, 10.0
# How often a client that has no daemon tries again, and how often something is looked at, s.
AGAIN_S, LOOK_EVERY_S = 0.02, 0.02
# Between two motions of a machine that measures: less than 19 times the age of its scales' readings, after which it is
# taken to rest (`departure_from_rest`).
DWELL_S = 0.08
# Mean time between two stalls of a busy computer, s.
STALLS_EVERY_S = 1.0
FOR_EVER_S = 1e6
_DECIMALS_S = 6


class VirtualMachine(Machine):
    """A world, the faults of its lines, and what is true of each of its setpoints. A context manager.

    expands : its links expand as steel does, and the daemon corrects it by its thermometers.
    """

    def __init__(self, seed: int = SEED, expands: bool = False) -> None:
        self.expands = expands
        self.world: World
        self._seed = seed
        self._running = ExitStack()
        self._held: dict[float, Held] = {}
        self._moved_s = -math.inf
        self._reloaded = False

    def __enter__(self) -> Self:
        self.world = self._running.enter_context(
            built(
                CONFIG / TRIPOD,
                self._seed,
                change=self._change,
                strengths=_measured if self.expands else lambda _: None,
                causes=self._expansion if self.expands else lambda _: (),
            )
        )
        self.state = self.world.directory / "state"
        self.injector = VirtualWires(self.world)
        self.world.hearers.append(self._note)
        self._own = self.world.configuration.path.read_text()
        self._supervisor = self.world.system.processes[SUPERVISOR]
        return self

    def __exit__(self, *_: object) -> None:
        self._running.close()

    def _change(self, document: dict[str, Any]) -> None:
        prepare(document)
        if self.expands:
            model = Path(self._running.enter_context(TemporaryDirectory())) / "expands.yaml"
            file_with(model, EXPANSION, **{EXPANSION: EXPANSION_PPM_PER_K})
            document["state"]["model_file"] = str(model)

    def _expansion(self, configuration: Configuration) -> list[Cause]:
        sizer = CauseSizer(configuration.geometry, configuration.wiring, self._seed)
        return [sizer.size(cause).cause for cause in parse_hidden([f"{EXPANSION}={EXPANSION_PPM_PER_K}"])]

    # --- time and the machine

    @property
    def now_s(self) -> float:
        return self.world.hub.now_s

    def rest_for(self, duration_s: float) -> None:
        self.world.run(duration_s)
        self.world.forget()

    def drive(self, scale_mm: Sequence[float]) -> None:
        self.world.drive(scale_mm)
        self.place_mm = tuple(scale_mm)
        self.world.arrive()
        self.rest_for(SETTLED_S)

    @contextmanager
    def shuttling(self, places_mm: Sequence[Sequence[float]]) -> Iterator[None]:
        """During the block the machine drives from one place to the next, with a short dwell at each."""
        world, places, goes_on, stands_since_s = self.world, cycle(places_mm), True, self.now_s - DWELL_S

        def look() -> None:
            nonlocal stands_since_s
            if not goes_on:
                return
            if world.moving:
                stands_since_s = self.now_s
            elif self.now_s >= stands_since_s + DWELL_S:
                world.drive(next(places))
            world.hub.at(self.now_s + LOOK_EVERY_S, look)

        look()
        self.rest_for(SETTLED_S)
        try:
            yield
        finally:
            goes_on = False

    @contextmanager
    def busy(self) -> Iterator[None]:
        """Other programs compute during the block, and the daemon's are late."""
        load = keep_busy(self.world, STALLS_EVERY_S)
        try:
            yield
        finally:
            load.end()

    # --- the daemon

    def kill(self, process: str) -> None:
        self.world.kill(process)

    def stall(self, process: str, duration_s: float) -> None:
        for_ever = math.isinf(duration_s)
        self.world.pause(FOR_EVER_S if for_ever else duration_s, process)
        self.rest_for(0.0 if for_ever else duration_s)

    def attack(self, name: str) -> None:
        raise NotImplementedError(f"{name}: a hostile client needs real sockets")

    def reload(self, exchanged: tuple[str, str] | None) -> None:
        self._reloaded = exchanged is not None
        if exchanged is None:
            self.world.configuration.path.write_text(self._own)
        else:
            self.world.reload(lambda document: exchange_ports(document, *exchanged))

    def ends(self) -> bool:
        end_s = self.now_s + ENDS_WITHIN_S
        while self._is_the_same and self.now_s < end_s:
            self.rest_for(LOOK_EVERY_S)
        return not self._is_the_same

    @property
    def _is_the_same(self) -> bool:
        """Whether the daemon that was started runs; another one is in its place soon after its end."""
        return self._supervisor.running and self._supervisor is self.world.system.processes[SUPERVISOR]

    def end_daemon(self) -> None:
        self.world.end()
        self.ends()
        self.world.stop()

    def start_daemon(self) -> None:
        self.world.start()
        self.rest_for(0.0)
        self._supervisor = self.world.system.processes[SUPERVISOR]

    def repair(self) -> None:
        self.injector.repair()
        if self._reloaded:
            self.reload(None)
            self.restart()
        self._supervisor = self.world.system.processes[SUPERVISOR]

    # --- clients

    @contextmanager
    def watched(self) -> Iterator[VirtualWatcher]:
        watcher = VirtualWatcher(self.world)
        process = self.world.system.start(watcher.run, "client watcher")
        try:
            yield watcher
        finally:
            process.kill()

    def accept(self) -> None:
        self._asked({"class": "ACCEPT", "gauge": "all"})

    def ask_all(self) -> None:
        self._asked({"class": "STATUS"})
        self._asked({"class": "MODEL"})

    def _asked(self, message: Message) -> None:
        clients = self.world.clients
        before, end_s = len(clients.answers), self.now_s + ANSWERED_WITHIN_S
        clients.ask(message)
        while len(clients.answers) == before and self.now_s < end_s:
            self.rest_for(LOOK_EVERY_S)
        answer = clients.answers[-1].message if len(clients.answers) > before else None
        if answer is None or answer["class"] == "ERROR":
            raise DaemonError.of(message["class"], str(answer))

    def hold(self, seen: Sequence[Seen]) -> list[Held]:
        return [self._held.get(round(one["time_s"], _DECIMALS_S), UNKNOWN) for one in seen]

    def _note(self, setpoint: Setpoint, told: Told) -> None:
        if told.moving:
            self._moved_s = told.time_s
        rested = told.time_s - max(setpoint.age_s or 0.0, SETTLED_S) > self._moved_s
        self._held[round(setpoint.time_s, _DECIMALS_S)] = Held(told.error_um, rested)


class VirtualWatcher:
    """A client of the daemon's Unix socket that takes every setpoint, and holds each to the rules."""

    def __init__(self, world: World) -> None:
        configuration = world.configuration
        loop = configuration.loop
        self.seen: list[Seen] = []
        self.ended = ""
        self.broken: list[str] = []
        self._rules = Rules(1 / loop.rate_hz, configuration.limits.slew_mm_per_s, loop.stale_after_s, loop.hold_s)
        self._system = world.system
        self._path = Path(configuration.sockets.unix.path)

    def run(self) -> None:
        """As a process of the world: from the first connection to its end."""
        while True:
            with suppress(OSError):
                connection = Connection(self._system, self._path)
                break
            self._system.sleep_until(self._system.monotonic() + AGAIN_S)
        try:
            with connection:
                connection.send({"class": "WATCH"})
                self._take(connection)
        except OSError as error:
            self.ended = str(error)

    def _take(self, connection: Connection) -> None:
        before = last_valid = None
        for message in connection.messages():
            if message["class"] != "SETPOINT":
                continue
            self.broken += [f"{rule}: {message}" for rule in broken_rules(message, before, last_valid, self._rules)]
            before, last_valid = message, message if message["valid"] else last_valid
            self.seen.append(Seen(self._system.monotonic(), message))


class VirtualWires:
    """The wires of a world, whose replies pass through faults."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._faults: dict[str, list[FaultOfLine]] = {}
        self._listeners = {name: wire.listener for name, wire in world.wires.items()}
        document = yaml.safe_load(world.configuration.path.read_text())
        for name, wire in world.wires.items():
            self._faults[name] = []
            protocol = protocol_of(name, document)

            def replies(reply: bytes, name: str = name, wire: Any = wire, protocol: Any = protocol) -> Any:
                exchange = Exchange(protocol, wire.request, reply)
                return [
                    (sent.delay_s + index * sent.gap_s, piece)
                    for sent in sent_through(self._faults[name], exchange, world.hub.now_s)
                    for index, piece in enumerate(
                        [bytes([byte]) for byte in sent.data] if sent.gap_s else [sent.data] if sent.data else []
                    )
                ]

            wire.fault = replies

    def fault(self, line: str, fault: Fault | None) -> None:
        if fault is None:
            self._faults[line].clear()
        else:
            self._faults[line].append(FaultOfLine(fault, self._world.hub.now_s))

    def unplug(self, *lines: str) -> None:
        for line in lines:
            self._world.wires[line].unplug()

    def plug(self, *lines: str) -> None:
        for line in lines:
            self._world.wires[line].replug()

    def replug(self, *lines: str) -> None:
        self.unplug(*lines)
        self.plug(*lines)

    def exchange(self, one: str, other: str) -> None:
        wires = self._world.wires
        wires[one].listener, wires[other].listener = self._listeners[other], self._listeners[one]

    def repair(self) -> None:
        for name, wire in self._world.wires.items():
            self._faults[name].clear()
            wire.listener = self._listeners[name]
            wire.replug()


def _measured(configuration: Configuration) -> Strengths:
    return seen_by(FULLY_MEASURED, len(configuration.wiring.joint))
