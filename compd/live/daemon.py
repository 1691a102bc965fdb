"""The daemon: every part put together, started in order, stopped in reverse."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import Any

import structlog

from compd import __version__
from compd.clock import Clock, MonotonicClock
from compd.configuration import Configuration
from compd.errors import StateError
from compd.live.acquisition.acquisition import Acquisition
from compd.live.loop.commands import Commands
from compd.live.loop.directions import Directions
from compd.live.loop.loop import Loop
from compd.live.loop.machine_zero import MachineZero, load_zero
from compd.live.loop.model_loader import ModelLoader, Models
from compd.live.loop.setpoint import Setpoint, State
from compd.live.pipeline import build_pipeline
from compd.live.service.messages import PROTOCOL, TargetKeys
from compd.live.service.model_switch import ModelSwitch
from compd.live.service.publisher import Publisher
from compd.live.service.readings_message import ReadingsMessage
from compd.live.service.requests import Requests
from compd.live.service.status_message import StatusReport
from compd.live.service.udp_sender import UdpSender
from compd.live.service.zero_capture import ZeroCapture
from compd.live.systemd import Notifier

# How soon the daemon notices that one of its threads has ended.
_LOOK_EVERY_S = 0.5

_log = structlog.get_logger()


class Daemon:
    """One machine's compensation. Raises CompdError from `start` when something cannot be had."""

    def __init__(
        self, configuration: Configuration, clock: Clock | None = None, notifier: Notifier | None = None
    ) -> None:
        clock = clock or MonotonicClock()
        self.configuration = configuration
        self._notifier = notifier or Notifier.from_environment()
        gauges = configuration.gauge_objects()
        self.latest, self._wires, cycle, shelf = build_pipeline(configuration, gauges)
        self.orders = Commands(self._zero_on_disk(), models=_first_models(configuration, shelf))
        self._model_adopter = ModelSwitch(shelf, self.orders)
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
        outlets = [*packets, directions.saw, self.publisher.deliver]
        self.loop = Loop(configuration.loop, cycle, self.latest, self.orders, outlets, self._notifier, clock)
        self._zero_taker = ZeroCapture(
            self._wires, self.latest, self.orders, _directory(configuration), configuration.zero_hash, clock
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
            configuration,
            self.latest,
            self._wires,
            self.orders,
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
            self.orders,
            report.message,
            self._zero_taker.take,
            ReadingsMessage(self._wires, self.latest.channels, directions),
            self._model_adopter.take,
        )
        self._state: State | None = None

    def start(self) -> None:
        """Gauges first, then the loop; the sockets appear when there are setpoints to be had."""
        self.acquisition.start()
        try:
            self.publisher.start(self._requests)
        except BaseException:
            self.acquisition.stop()
            raise
        self.loop.start()

    def stop(self) -> None:
        """Everything stopped, every thread ended."""
        self._notifier.stopping()
        self.loop.stop()
        self._zero_taker.stop()
        self._model_adopter.stop()
        self.publisher.stop()
        self.acquisition.stop()
        if self._packets is not None:
            self._packets.close()
        self._notifier.close()

    @property
    def healthy(self) -> bool:
        """Both threads that nothing replaces are alive."""
        return self.loop.alive and self.publisher.alive

    def _zero_on_disk(self) -> MachineZero | StateError:
        """The daemon runs without a zero, so that one can be taken; it says why it has none."""
        configuration = self.configuration
        try:
            zero = load_zero(_directory(configuration), configuration.zero_hash, self._wires.length_channels)
        except StateError as error:
            _log.warning("no machine zero", reason=str(error))
            return error
        _log.info("machine zero", taken_at=zero.taken_at)
        return zero

    def _note_state(self, setpoint: Setpoint) -> None:
        """Each change of state once, for the log and the service manager; on the publisher's thread."""
        if setpoint.state is self._state:
            return
        self._state = setpoint.state
        log = _log.info if setpoint.valid else _log.warning
        log("state", state=setpoint.state.value, reason=setpoint.reason, mode=setpoint.mode.value)
        self._notifier.status(f"{setpoint.state}: {setpoint.reason}" if setpoint.reason else setpoint.state)


def run(configuration: Configuration) -> bool:
    """Run until SIGTERM or Ctrl-C; True when a thread died instead. SIGHUP is kept for later and ignored."""
    _log_to_stderr()
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    # Blocked before any thread exists, so that none of them is ever interrupted by these.
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
        received = signal.sigtimedwait(signals, _LOOK_EVERY_S)
    healthy = daemon.healthy
    if received is not None:
        _log.info("stopping", signal=signal.Signals(received.si_signo).name)
    else:
        _log.error(
            "a thread has ended; its traceback is above", loop=daemon.loop.alive, publisher=daemon.publisher.alive
        )
    daemon.stop()
    return not healthy


def _first_models(configuration: Configuration, shelf: ModelLoader) -> Models:
    """Those of the configuration. Raises CompdError for a model file that cannot be used: it was asked for."""
    file = configuration.state.model_file
    if file is None:
        return Models(shelf.bare)
    model = shelf.read(Path(file))
    _log.info("model", file=file, hash=model.hash, effects=[one.effect.id for one in model.machine.live_effects])
    return Models(model)


def _directory(configuration: Configuration) -> Path:
    return Path(configuration.state.directory)


def _log_to_stderr() -> None:
    """One line per event, for the journal; colours only for a person."""
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
