"""A machine, its devices and the daemon's own parts in one process and in virtual time.

The truth, the devices and their wires are simulated; acquisition, drivers, trust, votes, loop and last readings are the
product's, unchanged. They run as greenlets on the clock of a hub, so that a seed gives the same setpoints each time.
"""

from __future__ import annotations

import math
import random
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from copy import deepcopy
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import structlog
import yaml

from compd.configuration import Configuration, load
from compd.documents import read_document
from compd.line_settings import powered
from compd.live.acquisition import LOOK_EVERY_S, Acquisition, Votes
from compd.live.loop import Commands, Loop, LoopTiming, Setpoint, build_pipeline
from compd.live.machine import MachineZero
from compd.live.service import LastReadings
from compd.live.wired_trust import wired_channels, wired_memory, wired_trust
from compd.plugins import SIMULATED_GAUGES
from compd.plugins import load as load_plugin
from compd.setpoint_states import State
from compd.simulation import World as Truth
from compd.simulation.truth.motion import DRIVES, Drives
from compd.simulation.truth.strengths import Strengths
from compd.simulation.wires.server import STEP_S, LiveWorld, Sensing
from tests.worlds.hub import Hub
from tests.worlds.wires import Wire, opened_virtually

# Processes of the daemon.
ACQUISITION, LOOP, SERVICE = "acquisition", "loop", "service"
_TAKEN_AT = "2026-01-01T00:00:00+00:00"
# Until every gauge has been read often enough after a start.
STARTS_WITHIN_S = 2.0


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
    """

    def __init__(self, hub: Hub, configuration: Configuration, truth: Truth, directory: Path, wires: dict[str, Wire]):
        self.hub = hub
        self.configuration = configuration
        self.truth = truth
        self.wires = wires
        self.shown: dict[str, Callable[[str, float], float]] = {}
        self.told: list[Told] = []
        self.hearers: list[Callable[[Setpoint, Told], None]] = []
        self._live = LiveWorld(truth, hub)
        self._directory = directory
        self._plug_in_devices()
        hub.every(STEP_S, self._live.step)
        self.start()

    def _plug_in_devices(self) -> None:
        configuration = self.configuration
        sensing = Sensing(configuration, self._live)
        for name, settings in configuration.lines.items():
            gauges = [gauge for gauge, options in configuration.gauges.items() if options.line == name]
            self.wires[settings.address] = self.wires[name] = Wire(
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
        shown = self.shown.get(gauge)
        return value if shown is None else shown(channel, value)

    # --- the daemon ------------------------------------------------------------------------------------

    def start(self, zero: MachineZero | None = None) -> None:
        """Start the daemon; `zero` is on its disk."""
        configuration = self.configuration
        self._pipeline = pipeline = build_pipeline(configuration, configuration.gauge_objects())
        self.trust = wired_memory(configuration, pipeline.wires)
        zero = zero or MachineZero(
            configuration.zero_hash, _TAKEN_AT, dict.fromkeys(pipeline.wires.length_channels, 0.0)
        )
        self.commands = Commands(zero)
        self.commands.models = pipeline.settings.without_effects
        last = LastReadings(self._directory, configuration.zero_hash, self.trust, self.hub)
        last.recall()
        self._timing = LoopTiming(pipeline.settings.period_s)
        self._newest: Setpoint | None = None
        self._service = [self.hub.spawn(last._run, SERVICE)]
        self.start_acquisition()
        self.start_loop()

    def start_acquisition(self) -> None:
        """Start the process that polls the gauges."""
        configuration, pipeline = self.configuration, self._pipeline
        trust = wired_trust(configuration, pipeline.wires, self.trust)
        gauges = configuration.gauge_objects()
        on_line = {
            line: [(name, gauges[name]) for name in gauges if configuration.gauges[name].line == line]
            for line in configuration.lines
        }
        stale_after_s = {
            name: configuration.loop.stale_after_s if options.stale_after_s is None else options.stale_after_s
            for name, options in configuration.gauges.items()
        }
        lines = {
            line: (powered(configuration.lines[line], [gauge for _, gauge in named]), named)
            for line, named in on_line.items()
        }
        self.acquisition = Acquisition(lines, stale_after_s, pipeline.latest, self.hub, trust=trust)
        votes = Votes(
            configuration.votes,
            self.trust,
            wired_channels(configuration, pipeline.wires, pipeline.settings.model),
            pipeline.wires.quantity_channels,
            pipeline.latest,
            lambda: self.zero.readings_mm,
            lambda: None if self._newest is None else self._newest.to_json(),
            configuration.geometry.scale_signal_period_mm or math.nan,
        )

        def look() -> None:
            while True:
                votes.look(self.hub.now_s)
                self.hub.sleep_until(self.hub.now_s + LOOK_EVERY_S)

        threads = [line._run for line in self.acquisition.lines.values()]
        self._polling = [self.hub.spawn(run, ACQUISITION) for run in (*threads, look)]

    def start_loop(self) -> None:
        """Start the process of the loop."""
        loop = Loop(
            self._pipeline.settings,
            self._pipeline.latest,
            self.commands,
            [self._note],
            self.hub,
            self._timing,
            sleep_until=self.hub.sleep_until,
        )
        loop.collector.collect_if_due = lambda _: None  # type: ignore[method-assign]  the collector of this process rests
        self._looping = [self.hub.spawn(lambda: loop.run(lambda: True), LOOP)]

    def kill_acquisition(self) -> None:
        """End the process that polls the gauges."""
        self.hub.kill(self._polling)

    def stop(self) -> None:
        """End the daemon at once."""
        self.hub.kill([*self._polling, *self._looping, *self._service])

    def pause(self, duration_s: float) -> None:
        """Let no process of the daemon run for so long, s."""
        for group in (ACQUISITION, LOOP, SERVICE):
            self.hub.pause(group, self.hub.now_s + duration_s)

    @property
    def zero(self) -> MachineZero:
        """The machine zero that is used."""
        zero = self.commands.zero
        assert isinstance(zero, MachineZero)
        return zero

    # --- persons ---------------------------------------------------------------------------------------

    def take_zero(self) -> None:
        """A person takes machine zero here, and accepts every gauge."""
        memory = self.trust
        readings_mm = {channel: float(memory.shown[i]) for channel, i in memory.index.items() if i < memory.lengths}
        self.commands.zero = MachineZero(self.configuration.zero_hash, _TAKEN_AT, readings_mm)
        self.accept()

    def accept(self, name: str = "all") -> None:
        """A person has looked at a gauge."""
        self.trust.accept(name)

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
        """Let time pass, s. Raises AssertionError where a part of the daemon has died."""
        self.hub.run(duration_s)
        assert not self.hub.died, self.hub.died[0]

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

    def _note(self, setpoint: Setpoint) -> None:
        self._newest = setpoint
        error_um = math.nan
        with self._live.now() as truth:
            if setpoint.values is not None:
                true_mm = truth.look().tip_M if truth.tip_frame == "M" else truth.look().tip_P
                error_um = 1e3 * float(np.linalg.norm(np.subtract(_tip_mm(setpoint, truth.tip_frame), true_mm)))
            moving = truth.phase == "moving"
        u_tip_um = math.nan if setpoint.u_tip_um is None else setpoint.u_tip_um
        told = Told(setpoint.time_s, setpoint.valid, setpoint.state, setpoint.reason, u_tip_um, error_um, moving)
        self.told.append(told)
        for hear in self.hearers:
            hear(setpoint, told)


def _tip_mm(setpoint: Setpoint, frame: str) -> np.ndarray:
    values = setpoint.values
    assert values is not None
    return np.asarray(values.tip_M_mm if frame == "M" else values.tip_P_mm)


@contextmanager
def built(
    path: Path,
    seed: int,
    drives: Drives = DRIVES,
    change: Callable[[dict[str, Any]], None] = lambda document: None,
    strengths: Callable[[Configuration], Strengths | None] = lambda configuration: None,
) -> Iterator[World]:
    """A world of a configuration, at machine zero, ready.

    change : of its document before it is loaded. strengths : of the truth's error sources; ordinary ones for None.
    """
    random.seed(seed)
    with ExitStack() as stack:
        directory = Path(tempfile.mkdtemp(prefix="compd-world-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))
        stack.callback(shutil.rmtree, directory, ignore_errors=True)
        document = deepcopy(read_document(path).data)
        change(document)
        document["state"] = {"directory": str(directory)}
        (directory / path.name).write_text(yaml.safe_dump(document, sort_keys=False))
        configuration = load(directory / path.name)
        wires: dict[str, Wire] = {}
        stack.enter_context(opened_virtually(lambda: wires))
        stack.enter_context(_quietly())
        errors = strengths(configuration)
        truth = Truth(
            configuration.geometry, configuration.wiring, seed, zero_hold_s=1e9, strengths=errors, drives=drives
        )
        world = World(Hub(seed), configuration, truth, directory, wires)
        stack.callback(world.stop)
        world.run(STARTS_WITHIN_S)
        world.take_zero()
        assert world.until_ok(), world.told[-1]
        yield world


@contextmanager
def _quietly() -> Iterator[None]:
    """Nobody reads the log."""
    before = structlog.get_config()
    structlog.configure(processors=[lambda *_: ""], logger_factory=structlog.ReturnLoggerFactory())
    try:
        yield
    finally:
        structlog.configure(**before)
