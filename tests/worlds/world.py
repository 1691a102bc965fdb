"""A machine, its devices and the whole daemon in one process and in virtual time.

The truth, the devices and their wires are simulated; supervisor, acquisition, drivers, trust, votes, loop, service and
state on disk are the product's, unchanged, on a `VirtualSystem`. A seed gives the same setpoints each time.
"""

from __future__ import annotations

import math
import random
import shutil
import signal
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from compd.configuration import Configuration, load
from compd.documents import read_document
from compd.errors import CompdError
from compd.live.daemon import Daemon
from compd.live.loop import Setpoint
from compd.live.loop.cycle_state import CycleSettings
from compd.live.machine import MachineZero
from compd.live.run_daemon import run_daemon
from compd.plugins import SIMULATED_GAUGES
from compd.plugins import load as load_plugin
from compd.setpoint_states import State
from compd.simulation import World as Truth
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.motion import DRIVES, Drives
from compd.simulation.truth.strengths import Strengths
from compd.simulation.wires.server import STEP_S, LiveWorld, Sensing
from tests.worlds.clients import Clients
from tests.worlds.controller import Controller
from tests.worlds.disk import recording_to
from tests.worlds.hub import Hub
from tests.worlds.observed import logged, observed
from tests.worlds.tips import tip_mm, true_tip_mm
from tests.worlds.virtual_system import VirtualSystem
from tests.worlds.wires import VirtualPorts, Wire

# Processes of the daemon.
SUPERVISOR, ACQUISITION, LOOP, SERVICE = "supervisor", "acquisition", "loop", "service"
# A loop with other models, before and after it has the turn.
NEXT_LOOP = "next loop"
# `RestartSec` of systemd/compd.service, s.
RESTART_S = 0.1
# Of a unit that a person restarts, s: until it starts.
STOPPED_S = 2.0
# Of a computer that boots, s: until the daemon starts.
BOOT_S = 5.0
# Until every gauge has been read often enough after a start.
STARTS_WITHIN_S = 4.0
ZERO_WITHIN_S = 6.0
# Setpoints per second of the program that watches.
WATCHED_HZ = 20.0
_LOG_ENTRIES = 1000
# Of each channel: true values that its device sensed last.
_SENSED = 512


class Told(NamedTuple):
    """One setpoint and the truth of its time. error_um : nan for one that is invalid; u_tip_um : nan where absent."""

    time_s: float
    valid: bool
    state: State
    reason: str
    u_tip_um: float
    error_um: float
    moving: bool


class World:
    """One machine with its daemon; `built` makes it.

    Attributes
    ----------
    wires : by name of the line. shown : by gauge, changes what its device senses: (channel, true value) -> value.
    told : every setpoint since the last `forget`. hearers : called with each setpoint and with what is true of it.
    clients, controller : of the daemon. cycle : settings of its newest loop. log : the last entries of its log.
    died : tracebacks in the daemon.
    """

    def __init__(self, hub: Hub, configuration: Configuration, truth: Truth, directory: Path) -> None:
        self.hub = hub
        self.configuration = configuration
        self.truth = truth
        self.shown: dict[str, Callable[[str, float], float]] = {}
        self._sensed: dict[str, deque[tuple[float, float]]] = {}
        self.told: list[Told] = []
        self.hearers: list[Callable[[Setpoint, Told], None]] = []
        self.beginners: list[Callable[[], object]] = []
        self.log: deque[Mapping[str, Any]] = deque(maxlen=_LOG_ENTRIES)
        self.directory = directory
        self.ports = VirtualPorts()
        self.system = VirtualSystem(hub, self.ports)
        self.wires: dict[str, Wire] = {}
        self.clients = Clients(self.system, Path(configuration.sockets.unix.path))
        self.daemon: Daemon | None = None
        self.cycle: CycleSettings | None = None
        self.controller = Controller(self.system, configuration, lambda scale_mm: self.drive(scale_mm.tolist()))
        self._on = False
        self._to_close: list[Daemon] = []
        self._live = LiveWorld(truth, self.system)
        self._plug_in_devices()
        hub.every(STEP_S, self._live.step)

    def _plug_in_devices(self) -> None:
        configuration = self.configuration
        sensing = Sensing(configuration, self._live)
        for name, settings in configuration.lines.items():
            gauges = [gauge for gauge, options in configuration.gauges.items() if options.line == name]
            self.ports.wires[settings.address] = self.wires[name] = Wire(
                self.hub,
                settings,
                [
                    load_plugin(SIMULATED_GAUGES, configuration.gauges[gauge].driver, gauge)(
                        configuration.gauges[gauge], partial(self._sense, gauge, sensing.of(gauge))
                    )
                    for gauge in gauges
                ],
            )

    def _sense(self, gauge: str, sense: Callable[[str], float], channel: str) -> float:
        value = sense(channel)
        name = f"{gauge}.{channel}"
        self._sensed.setdefault(name, deque(maxlen=_SENSED)).append((self.hub.now_s, value))
        shown = self.shown.get(gauge)
        return value if shown is None else shown(channel, value)

    def sensed_at(self, channel: str, time_s: float) -> float:
        """What a device would have shown without a fault at the sample nearest to this time (s); nan before any."""
        after_s, value = math.inf, math.nan
        for sampled_s, sampled in reversed(self._sensed.get(channel, ())):  # nearly always among the newest
            if time_s - sampled_s >= after_s - time_s:
                break
            after_s, value = sampled_s, sampled
            if sampled_s <= time_s:
                break
        return value

    # --- the daemon ------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start the daemon, as the service manager does; it starts it anew when it has failed."""
        self._on = True
        self.system.start(self._run_daemon, SUPERVISOR)

    def _run_daemon(self) -> None:
        try:
            failed = run_daemon(load(self.configuration.path), self.system)
        except CompdError as error:  # the command says so, and fails
            self.log.append({"event": "compd run", "problem": str(error), "time_s": self.hub.now_s})
            failed = True
        if failed and self._on:
            self.hub.at(self.hub.now_s + RESTART_S, self.start)

    def begun(self, daemon: Daemon) -> None:
        """A daemon has been made: this one, or the one of another configuration."""
        self.daemon = daemon
        self._to_close.append(daemon)
        for begin in self.beginners:
            begin()

    def closed(self, daemon: Daemon) -> None:
        """A daemon has closed its descriptors."""
        self._to_close.remove(daemon)

    def kill(self, process: str) -> None:
        """SIGKILL for a process of the daemon; the others end with the supervisor, which is started anew."""
        for name in self._named(process):
            self.system.processes[name].kill()
        if process == SUPERVISOR and self._on:
            self.stop()
            self.hub.at(self.hub.now_s + RESTART_S, self.start)

    def kill_acquisition(self) -> None:
        """End the process that polls the gauges."""
        self.kill(ACQUISITION)

    def pause(self, duration_s: float, process: str = "") -> None:
        """Let no process of the daemon run for so long, s; or one of them."""
        for name in self._named(process) if process else self._running():
            self.hub.pause(name, self.hub.now_s + duration_s)

    def _named(self, process: str) -> list[str]:
        names = [LOOP, NEXT_LOOP] if process == LOOP else [process]
        return [name for name in names if name in self._running()]

    def _running(self) -> list[str]:
        return [
            name for name, process in self.system.processes.items() if process.running and not name.startswith("client")
        ]

    def end(self) -> None:
        """A person stops the unit."""
        self._on = False
        self.system.send_signal(signal.SIGTERM)

    def restart(self) -> None:
        """A person restarts the unit."""
        self.end()
        self.hub.at(self.hub.now_s + STOPPED_S, self.start)

    def reload(self, change: Callable[[dict[str, Any]], None] = lambda document: None) -> None:
        """A person changes the configuration and reloads it."""
        path = self.configuration.path
        document = yaml.safe_load(path.read_text())
        change(document)
        path.write_text(yaml.safe_dump(document, sort_keys=False))
        self.system.send_signal(signal.SIGHUP)

    def reboot(self, off_s: float = BOOT_S) -> None:
        """The computer has no power for so long, s."""
        self.stop()
        self.system.boot()
        self.hub.at(self.hub.now_s + off_s, self.start)

    def set_clock(self, by_s: float) -> None:
        """Somebody sets the calendar's clock."""
        self.system.calendar_s += by_s

    def stop(self) -> None:
        """End the daemon at once."""
        self._on = False
        names = self._running()
        for name in sorted(names, key=lambda name: name == SUPERVISOR):
            self.system.processes[name].kill()
        for daemon in list(self._to_close):
            daemon.close()

    @property
    def died(self) -> list[str]:
        """Tracebacks of the daemon's processes and in its log."""
        return [*self.system.tracebacks, *(entry["exception"] for entry in self.log if entry.get("exception"))]

    @property
    def running(self) -> Configuration:
        """The configuration that the daemon runs with."""
        return self.configuration if self.daemon is None else self.daemon.configuration

    @property
    def zero(self) -> MachineZero:
        """The machine zero that is used."""
        assert self.daemon is not None
        zero = self.daemon.commands.zero
        assert isinstance(zero, MachineZero), zero
        return zero

    # --- persons: each asks, and the answer comes later ------------------------------------------------

    def take_zero(self) -> None:
        """A person takes machine zero here."""
        self.clients.ask({"class": "ZERO", "replace": True})

    def accept(self, gauge: str = "all") -> None:
        """A person has looked at a gauge."""
        self.clients.ask({"class": "ACCEPT", "gauge": gauge})

    def adopt(self, model: Path | None, shadow: bool = False) -> None:
        """A person adopts a model file, or none; or lets it run as the shadow."""
        beside = {"shadow": True} if shadow else {}
        self.clients.ask({"class": "MODEL", "file": "" if model is None else str(model), **beside}, model)

    def release(self) -> None:
        """A person takes the controller's role away."""
        self.clients.ask({"class": "RELEASE"})

    # --- the machine -----------------------------------------------------------------------------------

    def drive(self, scale_mm: Sequence[float]) -> None:
        """Begin to drive to these scale values, (n,) mm."""
        with self._live.now() as truth:
            truth.command(scale_mm)

    @property
    def moving(self) -> bool:
        return self.truth.phase == "moving"

    def arrive(self, within_s: float = 30.0) -> None:
        """Let time pass until the machine stands."""
        end_s = self.hub.now_s + within_s
        self.run(STEP_S)
        while self.moving and self.hub.now_s < end_s:
            self.run(STEP_S)

    def scale_mm(self) -> np.ndarray:
        """(n,) true scale values now."""
        with self._live.now() as truth:
            return np.array(truth._motion.position_mm)

    # --- time and setpoints ----------------------------------------------------------------------------

    def run(self, duration_s: float) -> None:
        """Let time pass, s."""
        self.hub.run(duration_s)

    def forget(self) -> float:
        """Forget the setpoints so far; the time, s."""
        self.told.clear()
        return self.hub.now_s

    def until_ok(self, within_s: float = 10.0) -> bool:
        """Let time pass until the state is ok; whether it became so within this time, s."""
        end_s = self.hub.now_s + within_s
        while self.hub.now_s < end_s:
            self.run(0.05)
            if self.told and self.told[-1].state is State.OK:
                return True
        return False

    def tip_error_mm(self, setpoint: Setpoint) -> np.ndarray:
        """(3,) of a valid setpoint of now."""
        with self._live.now() as truth:
            return tip_mm(setpoint, truth.tip_frame) - true_tip_mm(setpoint, truth)

    def note(self, setpoint: Setpoint) -> None:
        """A loop has made a setpoint."""
        error_um = math.nan
        with self._live.now() as truth:
            if setpoint.values is not None:
                error_um = 1e3 * math.dist(tip_mm(setpoint, truth.tip_frame), true_tip_mm(setpoint, truth))
            moving = truth.phase == "moving"
        u_tip_um = math.nan if setpoint.u_tip_um is None else setpoint.u_tip_um
        told = Told(setpoint.time_s, setpoint.valid, setpoint.state, setpoint.reason, u_tip_um, error_um, moving)
        self.told.append(told)
        for hear in self.hearers:
            hear(setpoint, told)


@contextmanager
def built(
    path: Path,
    seed: int,
    drives: Drives = DRIVES,
    change: Callable[[dict[str, Any]], None] = lambda document: None,
    strengths: Callable[[Configuration], Strengths | None] = lambda configuration: None,
    causes: Callable[[Configuration], Sequence[Cause]] = lambda configuration: (),
) -> Iterator[World]:
    """A world of a configuration, at machine zero, ready.

    change : of its document before it is loaded. strengths : of the errors of the machine. causes : beside them.
    """
    random.seed(seed)
    with ExitStack() as stack:
        directory = Path(tempfile.mkdtemp(prefix="compd-world-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
        stack.callback(shutil.rmtree, directory, ignore_errors=True)
        document = deepcopy(read_document(path).data)
        change(document)
        document["state"] = {**document.get("state", {}), "directory": str(directory / "state")}
        sockets = document.setdefault("sockets", {})
        sockets["unix"] = {"path": str(directory / "socket")}
        for other in ("tcp", "udp"):
            sockets.pop(other, None)
        (directory / path.name).write_text(yaml.safe_dump(document, sort_keys=False))
        configuration = load(directory / path.name)
        truth = Truth(
            configuration.geometry,
            configuration.wiring,
            seed,
            zero_hold_s=1e9,
            strengths=strengths(configuration),
            causes=causes(configuration),
            drives=drives,
        )
        hub = Hub(seed)
        world = World(hub, configuration, truth, directory)
        stack.enter_context(logged(world))

        stack.enter_context(observed(world))
        stack.enter_context(recording_to(world.system.disk))
        stack.callback(hub.close)
        stack.callback(world.stop)
        world.start()
        world.run(STARTS_WITHIN_S)
        world.take_zero()
        assert world.until_ok(ZERO_WITHIN_S), (world.told[-1:], world.clients.answers, world.died)
        world.clients.watch(WATCHED_HZ)
        yield world
