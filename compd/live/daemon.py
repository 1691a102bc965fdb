"""The daemon of one configuration: its parts, put together before its processes are forked.

    supervisor     the main process: forks the others, watches them, heeds signals
    loop           snapshot of the readings, one cycle, setpoint; nothing else, and in real time
    acquisition    polls the gauges, a thread for each line; "line NAME" is one of a line of its own
    service        sockets, machine zero, logs

Readings, setpoints and commands pass through shared memory, and nobody waits for anybody.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import structlog

from compd.columns import COMMANDED_ATTITUDE_COLUMNS, COMMANDED_COLUMNS, MODEL_COLUMNS
from compd.configuration import Configuration, listed_code
from compd.errors import DaemonError, StateError
from compd.kernel_versions import kernel_versions
from compd.line_settings import PushedLineSettings, powered
from compd.live.acquisition import Acquisition, Votes
from compd.live.loop import (
    AdoptedModels,
    Commands,
    Histogram,
    LoopTiming,
    Setpoint,
    TimedKinematics,
    build_pipeline,
)
from compd.live.machine import MachineZero, ModelLoader, Models, try_model, warn_of_datum, zero_at_start
from compd.live.memory import Control, PollRequests, SharedRing, TrustMemory
from compd.live.processes import AcquisitionProcess, LoopProcess, ServiceProcess, StateLog
from compd.live.service import (
    PROTOCOL,
    Acceptance,
    BudgetMessage,
    Errands,
    LastReadings,
    Listeners,
    LoopWatch,
    Messages,
    ModelKeeping,
    ModelSwitch,
    Publisher,
    ReadingsMessage,
    RequestContext,
    Requests,
    StatusReport,
    TargetKeys,
    TcpAccess,
    UdpSender,
    VersionKeys,
    ZeroCapture,
    machine_message,
)
from compd.live.system import THIS_COMPUTER, System, changed_ports, port_names
from compd.live.wired_trust import wired_channels, wired_memory, wired_trust
from compd.model import MachineModel
from compd.model.external import ExternalModel
from compd.not_measured import not_measured
from compd.release import __version__

_log = structlog.get_logger()


class Daemon:
    """The parts of one configuration.

    Attributes
    ----------
    configuration, latest, trust, commands, setpoints, control : as their names say.
    loop_process, acquisition, service : what each process does.
    period_s : of the loop.
    """

    def __init__(
        self, configuration: Configuration, before: Daemon | None = None, system: System = THIS_COMPUTER
    ) -> None:
        """`before`: the daemon whose place this one takes, and whose sockets it goes on with. `system`: on which its
        processes run.

        Raises CompdError for whatever cannot be had: a socket, the model file, a geometry that is impossible. Nothing
        of `before` has changed then.
        """
        self.configuration = configuration
        self._system = system
        gauges = configuration.gauge_objects()
        own_time = Histogram()
        pipeline = build_pipeline(
            configuration,
            gauges,
            listed_code(configuration.effects),
            partial(TimedKinematics, cost=own_time, clock=system),
        )
        self.period_s = pipeline.settings.period_s
        self.latest, self._wires = pipeline.latest, pipeline.wires
        models = _first_models(configuration, pipeline.loader)
        # compiles what the loop calls, so that its processes have it from their first cycle
        try_model(pipeline.settings.model, pipeline.loader.without_effects.quantities, str(configuration.path))
        sockets = configuration.sockets
        access = TcpAccess.of(sockets.tcp)
        packets = UdpSender(sockets.udp, system) if sockets.udp is not None else None
        try:
            self.listeners: Listeners = Listeners(sockets, None if before is None else before.listeners)
        except DaemonError:
            if packets is not None:
                packets.close()
            raise
        # what follows opens descriptors, and cannot fail
        self.ports = port_names(configuration)
        self.commands = Commands(self._first_zero())
        channels = len(self.latest.channels)
        self.setpoints, cycles, self.control = SharedRing(channels), SharedRing(channels), Control()
        adopted = AdoptedModels(models)
        packet_hash = bytes.fromhex(configuration.config_hash)[:8] if packets is not None else None
        timing = LoopTiming(self.period_s)
        self.loop_process = LoopProcess(
            pipeline.settings,
            self.latest,
            self.commands,
            pipeline.loader,
            adopted,
            timing,
            self.setpoints,
            cycles,
            packet_hash,
            self.control,
            system,
        )
        self.trust = self._trust(before)
        self._poll_requests = PollRequests(
            [
                name
                for name, options in configuration.gauges.items()
                if not isinstance(configuration.lines[options.line], PushedLineSettings)
            ]
        )
        self.acquisition = self._acquisition(pipeline.settings.model)
        self._pipes = {name: os.pipe2(os.O_CLOEXEC) for name in ("loop", *(a.name for a in self.acquisition))}
        watch = LoopWatch(self.setpoints, self.period_s, self.control.loop_fault.read, system.monotonic())
        observers = [StateLog(self.control).note]
        if packets is not None:
            observers.append(packets.deliver)
        publisher = Publisher(
            listeners=self.listeners,
            setpoints=self.setpoints,
            cycles=cycles,
            watch=watch,
            period_s=self.period_s,
            system=system,
            observers=observers,
            packet_hash=packet_hash,
        )
        zero_capture = ZeroCapture(
            self._wires,
            self.latest,
            self.commands,
            Path(configuration.state.directory),
            configuration.zero_hash,
            system,
            self.trust.accept,
            self.ports,
        )
        last_readings = LastReadings(
            Path(configuration.state.directory), configuration.zero_hash, self.trust, system, self.ports
        )
        self._changed_ports: Mapping[str, str] = {}
        if before is not None and before.trust is self.trust:
            self._changed_ports = changed_ports(before.ports, self.ports)
        else:
            last_readings.recall()
        keeping = ModelKeeping(configuration.path, configuration.state.model_file).keys
        model_switch = ModelSwitch(self.control, self.setpoints.wake_reader, system, keeping)
        version = VersionKeys.message(
            protocol=PROTOCOL,
            release=__version__,
            machine=configuration.machine,
            config_hash=configuration.config_hash,
            links=configuration.geometry.links,
            not_measured=not_measured(configuration),
            computed_by=kernel_versions(),
        )
        report = StatusReport(
            version=version,
            latest=self.latest,
            wires=self._wires,
            commands=self.commands,
            adopted=adopted,
            timing=timing,
            own_time=own_time if configuration.external is not None else None,
            control=self.control,
            publisher=publisher,
            packets=packets,
            lines=self._lines_status,
            trust=self.trust,
            clock=system,
            ports=self.ports,
        )
        requests = Requests(
            RequestContext(
                messages=Messages(
                    version=version,
                    machine=machine_message(configuration, self._wires),
                    status=report.message,
                    budget=BudgetMessage(pipeline.settings.model, self._newest_setpoint).message,
                    models=lambda: {**adopted.summary, **keeping(adopted.summary)},
                    readings=ReadingsMessage(
                        self._wires, self.latest.channels, *model_columns(pipeline.settings.model, configuration)
                    ),
                ),
                errands=Errands(
                    take_zero=zero_capture.start,
                    switch_model=model_switch.start,
                    accept=Acceptance(self.trust, system).start,
                    poll=self._poll_requests.add,
                    tell_order=publisher.tell_order,
                ),
                commands=self.commands,
                target_keys=_target_keys(configuration),
                targets=sockets.target,
                access=access,
                clock=system,
            )
        )
        logs = {name: reading for name, (reading, _) in self._pipes.items()}
        self.service = ServiceProcess(
            publisher,
            requests,
            zero_capture,
            last_readings,
            model_switch,
            packets,
            self.control,
            system,
            logs,
            configuration.loop.priority // 2,
        )

    def take_over(self) -> None:
        """Begin in the place of the daemon before, whose processes have ended: gauges at other ports are not believed.

        Machine zero was taken at ports, too; where these have changed, the log says so.
        """
        for gauge, change in self._changed_ports.items():
            _log.warning("gauge is at another port", gauge=gauge, change=change)
        self.trust.distrust_ports(self._changed_ports)
        zero = self.commands.zero
        if isinstance(zero, MachineZero):
            for gauge, change in changed_ports(zero.ports, self.ports).items():
                _log.warning("machine zero was taken at another port", gauge=gauge, change=change)

    def log_pipe(self, process: str) -> int:
        """The descriptor to which the process of this name prints."""
        return self._pipes[process][1]

    def close(self, after: Daemon | None = None) -> None:
        """Close every descriptor, but for the sockets that `after` goes on with; the processes have ended."""
        self.listeners.close(None if after is None else after.listeners)
        for pipe in self._pipes.values():
            for descriptor in pipe:
                os.close(descriptor)
        if self.service.packets is not None:
            self.service.packets.close()
        self.setpoints.close()
        self.loop_process.cycles.close()
        self.control.close()

    def _acquisition(self, model: MachineModel) -> list[AcquisitionProcess]:
        """One process for all lines but those that have one of their own; the first one looks at the votes."""
        configuration = self.configuration
        own = configuration.acquisition.own_process
        lines = configuration.lines
        groups = {"acquisition": [line for line in lines if line not in own]} | {f"line {line}": [line] for line in own}
        groups = {name: group for name, group in groups.items() if group}
        first = next(iter(groups), "")
        return [
            AcquisitionProcess(
                name,
                partial(self._polling, group, model if name == first else None),
                self.control,
                self._system,
                configuration.acquisition.memory_mb,
                configuration.loop.priority // 4,
            )
            for name, group in groups.items()
        ]

    def _polling(self, group: Sequence[str], model: MachineModel | None) -> tuple[Acquisition, Callable[[float], None]]:
        """What a process of the acquisition does with its lines: made in the process, so that each start is anew.

        model : for the votes of the gauges; None where another process has them.
        """
        configuration, gauges = self.configuration, self.configuration.gauge_objects()
        on_line = {
            line: [(name, gauges[name]) for name in gauges if configuration.gauges[name].line == line] for line in group
        }
        acquisition = Acquisition(
            {
                line: (powered(configuration.lines[line], [gauge for _, gauge in named]), named)
                for line, named in on_line.items()
            },
            {
                name: configuration.loop.stale_after_s if options.stale_after_s is None else options.stale_after_s
                for name, options in configuration.gauges.items()
            },
            self.latest,
            self._system,
            trust=wired_trust(configuration, self._wires, self.trust),
            poll_requests=self._poll_requests,
        )
        return acquisition, (lambda now_s: None) if model is None else self._votes(model).look

    def _votes(self, model: MachineModel) -> Votes:
        """What the gauges say of each other."""
        configuration = self.configuration

        def zero_mm() -> Mapping[str, float] | None:
            zero = self.commands.zero
            return zero.readings_mm if isinstance(zero, MachineZero) else None

        return Votes(
            configuration.votes,
            self.trust,
            wired_channels(configuration, self._wires, model),
            self._wires.quantity_channels,
            self.latest,
            zero_mm,
            self._newest_setpoint,
            configuration.geometry.scale_signal_period_mm or math.nan,
        )

    def _newest_setpoint(self) -> bytes | None:
        """The SETPOINT line of the loop's last cycle; None before the first."""
        count = self.setpoints.count
        content = self.setpoints.get(count - 1) if count else None
        return None if content is None else Setpoint.unpack(content).line

    def _trust(self, before: Daemon | None) -> TrustMemory:
        """What is known of the wired gauges: that of the daemon whose place this one takes, where it has the same."""
        memory = wired_memory(self.configuration, self._wires)
        if before is not None and before.configuration.zero_hash == self.configuration.zero_hash:
            before.trust.tolerance_mm[:] = memory.tolerance_mm
            return before.trust
        return memory

    def _lines_status(self) -> dict[str, Any]:
        """Every line's part of STATUS, by its name."""
        lines: dict[str, Any] = {}
        for process in self.acquisition:
            lines |= process.status()
        return lines

    def _first_zero(self) -> MachineZero | StateError:
        configuration, wires = self.configuration, self._wires
        directory, has_gauges = Path(configuration.state.directory), bool(wires.all_wires)
        return zero_at_start(directory, configuration.zero_hash, wires.length_channels, has_gauges, self._system)


def model_columns(model: MachineModel, configuration: Configuration) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Columns of a recording that are made of the setpoints, and the turn of {B0} in {M} that they need, or nothing.

    Of `machine: external` the pose that it gives, of a machine without scales the one that its controller is told.
    """
    if isinstance(model, ExternalModel):
        return (*MODEL_COLUMNS, *model.columns), ()
    if configuration.wiring.scale or configuration.geometry.tool.on == "plate":
        return (), ()
    attitude = COMMANDED_ATTITUDE_COLUMNS if model.attitude_is_free else ()
    return (*COMMANDED_COLUMNS, *attitude), configuration.geometry.base.rotation_B0_in_M_rad


def _target_keys(configuration: Configuration) -> TargetKeys:
    """Which keys TARGET has on this machine."""
    if (external := configuration.external) is not None:
        gives = external.own_class is None
        return TargetKeys(tip="tip_B0_mm" if gives else "", rotation=gives, scales=external.links if gives else 0)
    return TargetKeys(
        tip="tip_P_mm" if configuration.geometry.tool.on == "plate" else "tip_B0_mm",
        rotation=not set(configuration.geometry.mechanism.target_fixes).isdisjoint("abc"),
    )


def _first_models(configuration: Configuration, loader: ModelLoader) -> Models:
    """The models with which the daemon starts. Raises CompdError for a model file that cannot be used."""
    file = configuration.state.model_file
    if file is None:
        return Models(loader.without_effects)
    model = loader.read(Path(file))
    for warning in model.warnings:
        _log.warning("model file", reason=str(warning))
    _log.info("model", file=file, hash=model.hash, effects=[fitted.effect.id for fitted in model.machine.live_effects])
    warn_of_datum(model, _log)
    return Models(model)
