"""The running simulation: a world that follows the clock, its gauges on their lines, its control socket."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from compd.clock import Clock
from compd.configuration import Configuration, resolve_channel
from compd.line_settings import LineSettings, PolledLineSettings
from compd.lines import PushedDefinition, definition_of
from compd.plugins import SIMULATED_GAUGES, load
from compd.simulation.truth.follow_motion import MotorCommand
from compd.simulation.truth.instruments import INTERFEROMETER, TRACKER
from compd.simulation.truth.warm_up import COLUMNS, Heat
from compd.simulation.truth.world import World
from compd.simulation.wires.control import Answer, ControlSocket, Handler
from compd.simulation.wires.daemon_configuration import Port, daemon_configuration, daemon_path
from compd.simulation.wires.simulated_line import SimulatedLine
from compd.simulation.wires.simulation_directory import CONTROL_SOCKET, PORTS, SimulationDirectory
from compd.simulation.wires.tcp_port import ANY, claimed_port
from compd.twins import Sense, SimulatedPushedLine


class LiveWorld:
    """A world that follows a clock. Access is serialised by a lock.

    The scales show where the machine is when they are asked, as those of a machine that moves without steps do. All
    else changes little from one step to the next.
    """

    def __init__(self, world: World, clock: Clock) -> None:
        self._world = world
        self._clock = clock
        self._lock = threading.Lock()
        self._last_s = clock.monotonic()

    @contextmanager
    def now(self) -> Iterator[World]:
        """The world with its present motion, for exclusive use."""
        with self._lock:
            self._world.move(self._passed_s())
            yield self._world

    def step(self) -> None:
        """Warm up, bend and read every gauge."""
        with self._lock:
            self._world.advance(self._passed_s())

    def start(self) -> None:
        """Let time pass from now on."""
        self._last_s = self._clock.monotonic()

    @property
    def names(self) -> Sequence[str]:
        """Names of everything that can be sensed."""
        return self._world.names

    def sense(self, name: str) -> float:
        """Reading of a gauge, in its unit. Raises CompdError for a name that is not in `names`."""
        if not name.startswith("scale_"):
            return self._world.sense(name)
        with self._lock:
            self._world.move(self._passed_s())
            return self._world.sense_scale(name)

    def _passed_s(self) -> float:
        """Seconds since the last access; called under the lock."""
        now_s = self._clock.monotonic()
        passed_s, self._last_s = now_s - self._last_s, now_s
        return passed_s


# Source by unit for a channel that is not wired or that the simulated machine does not have; otherwise 0.
_IDLE_SOURCE = {"degC": "temperature_room_degC", "hPa": "pressure_hPa", "pct": "humidity_pct"}


class Sensed(Protocol):
    """A source of readings by name: a `World`, or a `LiveWorld`."""

    @property
    def names(self) -> Sequence[str]: ...
    def sense(self, name: str) -> float: ...


class Sensing:
    """Gives each gauge its `Sense`: values of its channels, with the gauge's own sign."""

    def __init__(self, configuration: Configuration, world: Sensed) -> None:
        self._world = world
        wiring = configuration.wiring
        wires = [
            *((f"scale_{wire.link}", wire.gauge, wire.sign) for wire in wiring.scale),
            *((f"joint_{k + 1}", wire.gauge, wire.sign) for k, wire in enumerate(wiring.joint)),
            *((f"frame_{wire.distance}", wire.gauge, wire.sign) for wire in wiring.frame),
            *((wire.name, wire.gauge, 1) for wire in wiring.quantities),
        ]
        wired = {
            resolve_channel(gauge, configuration.gauges, configuration.drivers): (name, sign)
            for name, gauge, sign in wires
        }
        self._sources: dict[str, dict[str, Callable[[], float]]] = {}
        for gauge, driver in configuration.gauge_objects().items():
            self._sources[gauge] = {}
            for channel in driver.channels:
                name, sign = wired.get(f"{gauge}.{channel.name}", ("", 1))
                if name not in world.names:
                    name, sign = _IDLE_SOURCE.get(channel.unit, ""), 1
                self._sources[gauge][channel.name] = self._source(name, sign)

    def of(self, gauge: str) -> Sense:
        """The function by which the simulated device of this gauge asks for its channels' values."""
        sources = self._sources[gauge]
        return lambda channel: sources[channel]()

    def _source(self, name: str, sign: int) -> Callable[[], float]:
        return (lambda: sign * self._world.sense(name)) if name else (lambda: 0.0)


# Step in which the world warms up and bends. Its scales follow the motion without steps.
STEP_S = 0.02
# The instruments' noise does not depend on the machine's seed.
TRACKER_SEED = 17
INTERFEROMETER_SEED = 18


class Simulation:
    """A configured machine, simulated on real ports. Access to the world is serialised by a lock."""

    def __init__(
        self,
        configuration: Configuration,
        world: World,
        directory: Path,
        clock: Clock,
        broker: tuple[str, int] | None = None,
    ) -> None:
        """directory : existing, for ports, sockets, state and the daemon's configuration.

        broker : host and port of the MQTT broker to which lines of kind mqtt publish.
        Raises CompdError for such a line without a broker, PluginError for a driver without a simulated device,
        ConfigurationError where `directory` holds the machine's own configuration.
        """
        daemon_path(configuration, directory)
        self.configuration = configuration
        self.world = world
        self.directory = directory
        self.ports: Mapping[str, Port] = {}
        self._clock = clock
        self._tracker_rng = np.random.default_rng(TRACKER_SEED)
        self._interferometer_rng = np.random.default_rng(INTERFEROMETER_SEED)
        self._live = LiveWorld(world, clock)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="world", daemon=True)
        sensing = Sensing(configuration, self._live)
        self._ports_directory = directory / PORTS
        self._own = SimulationDirectory(directory, configuration.path.name)
        self.lines: Mapping[str, SimulatedLine | SimulatedPushedLine] = {
            name: self._line(name, settings, sensing, broker) for name, settings in configuration.lines.items()
        }
        self._handlers: Mapping[str, Handler] = {
            "TRUTH": lambda _: self.truth(),
            "MEASURE": lambda _: self.measure(),
            "DRIVE": self._drive,
            "FOLLOW": self._follow,
            "TOUR": self._tour,
            "PLAN": self._plan,
            "TIP_FOR": self._tip_for,
            "LOAD": self._load,
            "HEAT": self._heat,
            "FAULT": self._fault,
            "LINES": lambda _: self._fault_states(),
        }
        self._running = ExitStack()

    def start(self) -> Configuration:
        """Open every port; returns the daemon's configuration, which is also written to `directory`.

        Raises CompdError if another simulator or a daemon runs in the directory.
        """
        self._own.begin()
        self._running.callback(self._own.end)
        self._ports_directory.mkdir(exist_ok=True)
        ports = {}
        for name, line in self.lines.items():
            ports[name] = line.start()
            self._running.callback(line.stop)
        self.ports = ports
        tcp = self.configuration.sockets.tcp
        tcp_port = ANY if tcp is None else self._running.enter_context(claimed_port(tcp.port))
        daemon = daemon_configuration(self.configuration, ports, self.directory, tcp_port, self.world.unnatural_K_per_s)
        self._thread.start()
        self._running.callback(self._thread.join)
        self._running.callback(self._stop.set)
        # last: the socket's appearance tells others that the simulation is ready
        control = ControlSocket(self.directory / CONTROL_SOCKET, self._handlers)
        self._running.callback(control.stop)
        return daemon

    def stop(self) -> None:
        """Close every port and socket, and remove the daemon's configuration and state."""
        self._running.close()

    def _run(self) -> None:
        self._live.start()
        while not self._clock.wait(self._stop, STEP_S):
            self._live.step()

    def _line(
        self, name: str, settings: LineSettings, sensing: Sensing, broker: tuple[str, int] | None
    ) -> SimulatedLine | SimulatedPushedLine:
        gauges = [gauge for gauge, options in self.configuration.gauges.items() if options.line == name]
        devices = [self._device(gauge, sensing) for gauge in gauges]
        definition = definition_of(settings)
        if isinstance(definition, PushedDefinition):
            return definition.simulated_line(name, devices, broker)
        assert isinstance(settings, PolledLineSettings)
        return SimulatedLine(name, settings, devices, self._ports_directory)

    def _device(self, gauge: str, sensing: Sensing) -> Any:
        driver = self.configuration.gauges[gauge].driver
        where = f"{self.configuration.path} gauges.{gauge}.driver"
        return load(SIMULATED_GAUGES, driver, where)(self.configuration.gauges[gauge], sensing.of(gauge))

    # --- requests on the control socket ---------------------------------------------------------------

    def truth(self) -> Answer:
        """True tip and state of motion: the TRUTH message. monotonic_s : as in MEASURED, of all the others."""
        with self._live.now() as world:
            monotonic_s = self._clock.monotonic()
            state = world.look()
            tip_mm = state.tip_M if world.tip_frame == "M" else state.tip_P
            return {
                "class": "TRUTH",
                "time_s": round(world.time_s, 6),
                "monotonic_s": monotonic_s,
                "weather_time_s": round(world.weather_time_s, 6),
                "mode": world.mode,
                "phase": world.phase,
                "moving": world.phase == "moving",
                "point": world.point,
                "zero_hold_s": round(world.zero_hold_s, 3),
                "tip_frame": world.tip_frame,
                "tip_mm": tip_mm.tolist(),
                "scale_mm": state.scale_mm.tolist(),
                **({} if world.plan_motion is None else {"plan": world.plan_motion.progress()}),
            }

    def measure(self) -> Answer:
        """The tip as a laser tracker on the surface plate shows it now, and the links' lengths: the MEASURED message.

        monotonic_s : on the clock that also stamps the gauges' readings. link_mm : change of each link's length since
        machine zero, as interferometers along the links show it.
        """
        with self._live.now() as world:
            state = world.look()
            tip_mm = TRACKER.measure(state.shown, self._tracker_rng)
            link_mm = INTERFEROMETER.measure(state.link_mm - world.mechanism.lengths0_mm, self._interferometer_rng)
            return {
                "class": "MEASURED",
                "instrument": "laser tracker",
                "time_s": round(world.time_s, 6),
                "monotonic_s": self._clock.monotonic(),
                "moving": world.phase == "moving",
                "tip_frame": world.tip_frame,
                "reference_mm": [round(value, 6) for value in tip_mm.tolist()],
                "sigma_um": TRACKER.sigma_um,
                "link_mm": [round(value, 6) for value in link_mm.tolist()],
                "link_sigma_um": INTERFEROMETER.sigma_um,
            }

    def _drive(self, message: Mapping[str, Any]) -> Answer:
        with self._live.now() as world:
            world.command(message["scale_mm"])
        return self.truth()

    def _follow(self, message: Mapping[str, Any]) -> Answer:
        commands = [
            MotorCommand(float(time_s), np.array(scale_mm, dtype=float)) for time_s, *scale_mm in message["commands"]
        ]
        with self._live.now() as world:
            world.follow(commands)
            mode, phase = world.mode, world.phase
        return {"class": "FOLLOWS", "mode": mode, "moving": phase == "moving"}

    def _tour(self, _: Mapping[str, Any]) -> Answer:
        with self._live.now() as world:
            world.start_tour()
        return self.truth()

    def _plan(self, _: Mapping[str, Any]) -> Answer:
        with self._live.now() as world:
            world.start_plan()
        return self.truth()

    def _tip_for(self, message: Mapping[str, Any]) -> Answer:
        with self._live.now() as world:
            tip_mm = world.tip_for(message["scale_mm"])
        return {"class": "TIP", "tip_frame": self.world.tip_frame, "tip_mm": tip_mm.tolist()}

    def _load(self, message: Mapping[str, Any]) -> Answer:
        force_M_N = np.array(message["force_M_N"], dtype=float)
        if force_M_N.shape != (3,) or not np.all(np.isfinite(force_M_N)):
            raise ValueError("force_M_N: three finite numbers, N")
        with self._live.now() as world:
            world.force_M_N = force_M_N
        return self.truth()

    def _heat(self, message: Mapping[str, Any]) -> Answer:
        drives_W, cabinet_W = ([_watts(value) for value in message[name]] for name in ("drives_W", "cabinet_W"))
        links = self.world.mechanism.links
        if (len(drives_W), len(cabinet_W)) != (links, COLUMNS):
            raise ValueError(f"drives_W: {links} numbers, one per link; cabinet_W: {COLUMNS}, one per column")
        ring_W, platform_W, tool_W, lamps_W = (
            _watts(message[name]) for name in ("ring_W", "platform_W", "tool_W", "lamps_W")
        )
        with self._live.now() as world:
            world.heat(Heat(np.array(drives_W), ring_W, np.array(cabinet_W), platform_W, tool_W, lamps_W))
        return self.truth()

    def _fault(self, message: Mapping[str, Any]) -> Answer:
        name = message["line"]
        if name not in self.lines:
            raise ValueError(f"no line {name!r}; there are " + ", ".join(self.lines))
        self.lines[name].fault = message["fault"]
        return self.truth()

    def _fault_states(self) -> Answer:
        lines = {name: {"fault": line.fault, "faults": list(line.faults)} for name, line in self.lines.items()}
        return {"class": "LINES", "lines": lines}


def _watts(value: Any) -> float:
    watts = float(value)
    if not 0 <= watts < np.inf:
        raise ValueError(f"{value}: what is switched on gives off 0 W or more")
    return watts
