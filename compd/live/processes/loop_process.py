"""What the process of a loop does: prepare for real time, take up the state of the loop before it, and cycle.

A loop never changes its models. Other ones come with a successor: a process that reads and tries them, computes some
cycles that nobody sees, so that nothing of it has yet to be compiled or fetched into memory, and then takes the turn
between two ticks.
"""

from __future__ import annotations

from dataclasses import dataclass

import structlog

from compd.errors import CompdError, StateError
from compd.live.loop import (
    AdoptedModels,
    Commands,
    CycleInputs,
    CyclePacker,
    CycleSettings,
    CycleState,
    CycleUnpacker,
    Directions,
    Loop,
    LoopTiming,
    Setpoint,
    step,
)
from compd.live.machine import LiveModel, MachineZero, ModelLoader, Models, ModelText, warn_of_datum
from compd.live.memory import Control, Latest, SharedRing
from compd.live.system import System
from compd.operation_settings import LoopSettings

# Cycles that a loop computes before the first that counts.
_TRIAL_CYCLES = 20
# Priority for these cycles, below every `loop.priority`.
_TRIAL_PRIORITY = 1
# From this rate on processors are kept awake, Hz: to wake them takes a tenth of the period and more.
_AWAKE_FROM_HZ = 500.0
# A loop that is alive gives the turn within a period.
_TURN_WITHIN_S = 2.0

_log = structlog.get_logger()


def wake_latency_us(settings: LoopSettings) -> int | None:
    """How long a processor may take to wake, us; None for no limit."""
    if settings.wake_latency_us is None and settings.rate_hz >= _AWAKE_FROM_HZ:
        return 0
    return settings.wake_latency_us


@dataclass(frozen=True)
class ModelChange:
    """A change of models that a client asks for.

    number : of the request. text : of the model file; None for none. shadow : whether it is to be computed beside the
    applied one. hash : of the model that runs as the shadow and is to be applied; "" where `text` counts.
    """

    number: int
    text: ModelText | None
    shadow: bool
    hash: str = ""

    @property
    def name(self) -> str:
        """What is asked for, for the log."""
        return self.hash or ("none" if self.text is None else self.text.file)


@dataclass(frozen=True)
class LoopProcess:
    """The parts of the daemon that a loop needs, all made before its process was forked.

    setpoints, cycles : the rings, see `compd.live.loop.ring_entries`. packet_hash : first bytes of the configuration's
    hash, for UDP packets; None where they are not configured.
    """

    settings: CycleSettings
    latest: Latest
    commands: Commands
    loader: ModelLoader
    adopted: AdoptedModels
    timing: LoopTiming
    setpoints: SharedRing
    cycles: SharedRing
    packet_hash: bytes | None
    control: Control
    system: System

    def run(self, number: int, forget: bool = False) -> None:
        """Cycle as loop `number`, which has the turn. forget : begin anew but for the correction that is applied."""
        models = self.adopted.load(self.loader)
        commands = self.commands.with_models(models)
        loop = self._loop(commands)
        self._prepare(loop)
        self._try_cycles(self._state_left(models, forget), commands)
        self.system.privileges.use_fifo(self.settings.loop.priority)
        loop.run(lambda: self.control.keeps_turn(number), self.control.ending, self._state_left(models, forget))

    def run_successor(self, number: int, request: ModelChange) -> None:
        """Read and try the model that is asked for, take the turn and cycle; or answer why not."""
        control = self.control
        try:
            before = self.adopted.load(self.loader)
            models = self._models_wanted(before, request)
            wanted = models.shadow if request.shadow else models.applied
            self._require_zero(wanted)
            commands = self.commands.with_models(models)
            loop = self._loop(commands)
            self._prepare(loop)
            self._try_cycles(self._state_left(before, forget=False), commands)
        except (Exception, SystemExit) as error:  # noqa: BLE001  an effect of a user's own may do anything
            reason = str(error) if isinstance(error, CompdError | ValueError) else f"{type(error).__name__}: {error}"
            _log.warning("model refused", file=request.name, reason=reason)
            self.answer(request.number, None, reason)
            return
        self.system.privileges.use_fifo(self.settings.loop.priority)
        if not control.await_turn(number, _TURN_WITHIN_S, self.system.selector):
            self.answer(request.number, None, "the loop does not answer")
            return
        state = self._state_left(before, forget=False)
        self.adopted.write(models)
        self.answer(request.number, models.summary, "")
        if wanted is not None:
            warn_of_datum(wanted, _log)
        loop.run(lambda: control.keeps_turn(number), control.ending, state)

    def answer(self, number: int, summary: object, refusal: str) -> None:
        """Answer request `number`, and wake the service, which sends the answer."""
        self.control.model_answer.write((number, summary, refusal))
        self.setpoints.wake_reader()

    def _models_wanted(self, before: Models, request: ModelChange) -> Models:
        """The pair of applied model and shadow with the new one (none: no effects, or no shadow) in its place."""
        if request.hash:
            return _shadow_applied(before, request.hash)
        model: LiveModel | None = None if request.text is None else self.loader.load(request.text)
        if request.shadow:
            return Models(before.applied, model)
        if model is not None and before.shadow is not None and model.hash == before.shadow.hash:
            # the same object that ran as a shadow: its effects keep their memory
            return Models(before.shadow)
        return Models(model or self.loader.without_effects, before.shadow)

    def _require_zero(self, model: LiveModel | None) -> None:
        """Raise StateError where machine zero lacks a quantity from which an effect of the model counts."""
        zero = self.commands.zero
        if model is not None and isinstance(zero, MachineZero) and (missing := model.missing_at_zero(zero)):
            raise StateError.of(model.file, missing)

    def _loop(self, commands: Commands) -> Loop:
        packer = CyclePacker(Directions(self.settings.wires.scale.wires))

        def send(setpoint: Setpoint) -> None:
            time_s, state = setpoint.time_s, setpoint.state.code
            line, content = setpoint.pack(self.packet_hash)
            self.setpoints.put(time_s, state, content)
            self.cycles.put(time_s, state, packer.pack(setpoint, line))

        return Loop(self.settings, self.latest, commands, [send], self.system, self.timing)

    def _prepare(self, loop: Loop) -> None:
        """Ask the system for what real time needs. What it does not permit is told, and the loop runs without it."""
        settings, privileges = self.settings.loop, self.system.privileges
        privileges.sharpen_timers()
        permissions = {"quiet_collector": loop.collector.start(self.system.monotonic())}
        if settings.lock_memory:
            permissions["locked_memory"] = privileges.lock_memory()
        if (latency_us := wake_latency_us(settings)) is not None:
            permissions["wake_latency"] = privileges.limit_wake_latency(latency_us)
        permissions["sched_fifo"] = privileges.use_fifo(settings.priority)
        # what follows must not get in the way of the loop that has the turn
        privileges.use_fifo(_TRIAL_PRIORITY)
        self.control.realtime.write({name: permission._asdict() for name, permission in permissions.items()})

    def _try_cycles(self, state: CycleState, commands: Commands) -> None:
        """Compute cycles that nobody sees. Raises ValueError for models whose state does not fit into the ring."""
        packer = CyclePacker(Directions(self.settings.wires.scale.wires))
        for tick in range(1, _TRIAL_CYCLES + 1):
            setpoint, state = step(state, self._inputs(tick, commands), self.settings)
            line, _ = setpoint.pack(self.packet_hash)
            # what effects remember may grow while the machine moves
            if len(packer.pack(setpoint, line)) > (most := self.cycles.longest_content // 2):
                raise ValueError(f"a cycle, with what its effects remember, has more than {most} bytes")

    def _inputs(self, tick: int, commands: Commands) -> CycleInputs:
        snapshot = self.latest.snapshot(self.system.monotonic())
        return CycleInputs(tick, snapshot, commands.zero, commands.target, commands.models)

    def _state_left(self, models: Models, forget: bool) -> CycleState:
        """The state that the last cycle left: that cycle is computed once more.

        models : with which it was computed. Where it cannot be computed again, or is to be forgotten, all that is kept
        is the correction that is applied, from which the next one slews.
        """
        start = CycleState.at_start(self.settings.model)
        content = self.cycles.get(self.cycles.count - 1) if self.cycles.count else None
        if content is None:
            return start
        sent = CycleUnpacker().unpack(content)
        inputs, state = sent.inputs, sent.state_before
        bare = start._replace(correction_mm=state.correction_mm, adopting=True)
        if forget or sent.models != models.names:
            return bare
        zero = self.commands.zero
        if isinstance(zero, MachineZero) and inputs.zero == zero:
            # one object: the cycle asks whether it is the same
            state = state._replace(zero=None if state.zero is None else zero)
            inputs = inputs._replace(zero=zero)
        try:
            _, left = step(state._replace(models=models), inputs._replace(models=models), self.settings)
        except Exception as error:  # noqa: BLE001  an effect of a user's own may have ended the loop in this very cycle
            _log.warning("the last cycle cannot be computed again", error=f"{type(error).__name__}: {error}")
            return bare
        return left


def _shadow_applied(models: Models, hash_: str) -> Models:
    """The shadow in the place of the applied model. Raises StateError where none of this hash runs as the shadow."""
    shadow = models.shadow
    if shadow is None or shadow.hash != hash_:
        raise StateError.of(
            "shadow",
            "no model of this hash runs as the shadow",
            value=hash_,
            allowed="none runs" if shadow is None else shadow.hash,
            next_step="let the model run as the shadow, and look at it, before it is applied",
        )
    return Models(shadow)
