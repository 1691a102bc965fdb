"""The daemon: acquisition, loop and services of one machine, started in order and stopped in reverse."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Any

import structlog

from compd.clock import Clock, MonotonicClock
from compd.configuration import Configuration
from compd.errors import StateError
from compd.live.acquisition.acquisition import Acquisition
from compd.live.loop.commands import Commands
from compd.live.loop.directions import Directions
from compd.live.loop.loop import Loop
from compd.live.loop.machine_zero import MachineZero, load_zero
from compd.live.loop.model_loader import ModelLoader, Models
from compd.live.loop.setpoint import Setpoint
from compd.live.loop.states import State
from compd.live.pipeline import build_pipeline
from compd.live.service.messages import PROTOCOL
from compd.live.service.model_switch import ModelSwitch
from compd.live.service.publisher import Publisher
from compd.live.service.readings_message import ReadingsMessage
from compd.live.service.requests import Requests, TargetKeys
from compd.live.service.status_message import StatusReport
from compd.live.service.udp_sender import UdpSender
from compd.live.service.zero_capture import ZeroCapture
from compd.live.systemd import Notifier
from compd.release import __version__

# How often the daemon looks whether one of its threads has ended.
_CHECK_EVERY_S = 0.5

_log = structlog.get_logger()


class Daemon:
    """The compensation of one machine. `start` raises CompdError where a line or socket cannot be opened."""

    def __init__(
        self, configuration: Configuration, clock: Clock | None = None, notifier: Notifier | None = None
    ) -> None:
        clock = clock or MonotonicClock()
        self.configuration = configuration
        self._notifier = notifier or Notifier.from_environment()
        gauges = configuration.gauge_objects()
        pipeline = build_pipeline(configuration, gauges)
        self.latest, self._wires = pipeline.latest, pipeline.wires
        self.commands = Commands(self._zero_on_disk(), models=_first_models(configuration, pipeline.loader))
        self._model_switch = ModelSwitch(pipeline.loader, self.commands)
        by_line = {
            line: (settings, [(name, gauges[name]) for name in gauges if configuration.gauges[name].line == line])
            for line, settings in configuration.lines.items()
        }
        self.acquisition = Acquisition(by_line, self.latest, clock)
        period_s = 1.0 / configuration.loop.rate_hz
        self.publisher = Publisher(configuration.sockets, period_s, self._note_state)
        udp = configuration.sockets.udp
        self._packets = UdpSender(udp, configuration.config_hash) if udp is not None else None
        directions = Directions(self._wires.scale.wires)
        packets = [] if self._packets is None else [self._packets.deliver]
        sinks = [*packets, directions.update, self.publisher.deliver]
        self.loop = Loop(pipeline.settings, self.latest, self.commands, sinks, self._notifier, clock)
        self._zero_capture = ZeroCapture(
            self._wires, self.latest, self.commands, _directory(configuration), configuration.zero_hash, clock
        )
        version: dict[str, Any] = {
            "class": "VERSION",
            "protocol": PROTOCOL,
            "release": __version__,
            "machine": configuration.machine,
            "config_hash": configuration.config_hash,
            "links": configuration.geometry.links,
        }
        report = StatusReport(
            version,
            self.latest,
            self._wires,
            self.commands,
            self.loop,
            self.publisher,
            self._packets,
            self.acquisition.status,
            clock,
        )
        keys = TargetKeys(
            tip="tip_B0_mm" if configuration.geometry.tool.on == "platform" else "tip_P_mm",
            rotation=configuration.geometry.kinematics == "hexapod_6ups",
        )
        self._requests = Requests(
            version,
            keys,
            self.commands,
            report.message,
            self._zero_capture.start,
            ReadingsMessage(self._wires, self.latest.channels, directions),
            self._model_switch.start,
        )
        self._state: State | None = None

    def start(self) -> None:
        """Start the acquisition, then the sockets, then the loop."""
        self.acquisition.start()
        try:
            self.publisher.start(self._requests)
        except BaseException:
            self.acquisition.stop()
            raise
        self.loop.start()

    def stop(self) -> None:
        """Stop everything; returns when every thread has ended."""
        self._notifier.stopping()
        self.loop.stop()
        self._zero_capture.stop()
        self._model_switch.stop()
        self.publisher.stop()
        self.acquisition.stop()
        if self._packets is not None:
            self._packets.close()
        self._notifier.close()

    @property
    def healthy(self) -> bool:
        """Whether the threads of loop and publisher, without which there are no setpoints, are alive."""
        return self.loop.alive and self.publisher.alive

    def _zero_on_disk(self) -> MachineZero | StateError:
        """The machine zero on disk, or why there is none: the daemon runs without one, so that it can be taken."""
        configuration = self.configuration
        try:
            zero = load_zero(_directory(configuration), configuration.zero_hash, self._wires.length_channels)
        except StateError as error:
            _log.warning("no machine zero", reason=str(error))
            return error
        _log.info("machine zero", taken_at=zero.taken_at)
        return zero

    def _note_state(self, setpoint: Setpoint) -> None:
        """Report a change of state to the log and the service manager; called on the publisher's thread."""
        if setpoint.state is self._state:
            return
        self._state = setpoint.state
        log = _log.info if setpoint.valid else _log.warning
        log("state", state=setpoint.state.value, reason=setpoint.reason, mode=setpoint.mode.value)
        self._notifier.status(f"{setpoint.state}: {setpoint.reason}" if setpoint.reason else setpoint.state)


def run(configuration: Configuration) -> bool:
    """Run the daemon until SIGTERM or Ctrl-C; True where a thread ended by itself. SIGHUP is ignored."""
    _log_to_stderr()
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    # blocked before any thread exists, so that these signals interrupt none of them
    signals = {signal.SIGTERM, signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    for warning in configuration.warnings:
        _log.warning("configuration", where=warning.where, what=warning.what)
    daemon = Daemon(configuration)
    daemon.start()
    _log.info(
        "running",
        machine=configuration.machine,
        config_hash=configuration.config_hash,
        rate_hz=configuration.loop.rate_hz,
        unix=configuration.sockets.unix.path,
        tcp_port=daemon.publisher.tcp_port,
    )
    received = None
    while received is None and daemon.healthy:
        received = signal.sigtimedwait(signals, _CHECK_EVERY_S)
    healthy = daemon.healthy
    if received is not None:
        _log.info("stopping", signal=signal.Signals(received.si_signo).name)
    else:
        _log.error(
            "a thread has ended; its traceback is above", loop=daemon.loop.alive, publisher=daemon.publisher.alive
        )
    daemon.stop()
    return not healthy


def _first_models(configuration: Configuration, loader: ModelLoader) -> Models:
    """The models with which the daemon starts. Raises CompdError for a model file that cannot be used."""
    file = configuration.state.model_file
    if file is None:
        return Models(loader.without_effects)
    model = loader.read(Path(file))
    _log.info("model", file=file, hash=model.hash, effects=[fitted.effect.id for fitted in model.machine.live_effects])
    return Models(model)


def _directory(configuration: Configuration) -> Path:
    """Where machine zero is kept."""
    return Path(configuration.state.directory)


def _log_to_stderr() -> None:
    """Log one line per event to stderr, with colours on a terminal."""
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso"),
            structlog.dev.ConsoleRenderer()
            if sys.stderr.isatty()
            else structlog.processors.LogfmtRenderer(key_order=["timestamp", "level", "event"]),
        ],
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )
