"""A configured machine without lines: its gauges show what the test says, its clock is a number."""

from __future__ import annotations

from dataclasses import replace

from compd.configuration import Configuration, load
from compd.gauge import Quality, bad, good
from compd.live.loop import Commands, CycleInputs, CycleState, build_pipeline, step
from compd.live.machine import MachineZero
from compd.setpoint_states import State
from tests.support.paths import CONFIG

RATE_HZ = 200
PERIOD_S = 1 / RATE_HZ
SLEW_MM_PER_S = 0.5
STEP_MM = SLEW_MM_PER_S * PERIOD_S
HOLD_S = 5.0
RAW_AT_ZERO_MM = 12.5  # every gauge shows this at machine zero


class Machine:
    """A configured machine whose gauges show what the test says."""

    def __init__(self, configuration: Configuration):
        self.configuration = configuration
        pipeline = build_pipeline(configuration, configuration.gauge_objects())
        self.latest, self.wires, self.loader = pipeline.latest, pipeline.wires, pipeline.loader
        self.model = pipeline.settings.model
        self.settings = replace(pipeline.settings, valid_for_s=0.1)
        self.state = CycleState.at_start(self.model)
        zero = dict.fromkeys(self.wires.length_channels, RAW_AT_ZERO_MM)
        quantities = dict.fromkeys(self.wires.quantity_names, 20.0)
        self.commands = Commands(MachineZero(configuration.zero_hash, "2026-01-01T00:00:00+00:00", zero, quantities))
        self.now_s = 1000.0
        self.tick = 0
        self.change_mm = dict.fromkeys(self.wires.length_channels, 0.0)
        self.faults: dict[str, Quality] = {}
        self.frozen: set[str] = set()

    def step(self, ending=""):
        """One period later: every gauge is read anew, unless it is faulty or frozen."""
        self.now_s += PERIOD_S
        self.tick += 1
        for channel, slot in self.latest.index.items():
            if channel in self.faults:
                self.latest.put(slot, bad(self.now_s - 0.001, self.faults[channel]))
            elif channel not in self.frozen:
                value = RAW_AT_ZERO_MM + self.change_mm[channel] if channel in self.change_mm else 20.0
                self.latest.put(slot, good(value, self.now_s - 0.001))
        return self.run_cycle(ending)

    def run_cycle(self, ending=""):
        """One cycle with the readings as they are: its setpoint."""
        commands = self.commands
        snapshot = self.latest.snapshot(self.now_s)
        inputs = CycleInputs(self.tick, snapshot, commands.zero, commands.target, commands.models, ending)
        setpoint, self.state = step(self.state, inputs, self.settings)
        return setpoint

    def settle(self):
        """Until the correction has arrived."""
        for _ in range(200):
            setpoint = self.step()
            if setpoint.state is State.OK:
                return setpoint
        raise AssertionError(setpoint)


def machine(name="tripod-cmm.yaml", **changes) -> Machine:
    configuration = load(CONFIG / name)
    loop = configuration.loop.model_copy(
        update={"rate_hz": RATE_HZ, "hold_s": HOLD_S, "stale_after_s": 0.5, "on_stale": changes.pop("on_stale", "hold")}
    )
    limits = configuration.limits.model_copy(update={"slew_mm_per_s": SLEW_MM_PER_S, "correction_mm": 0.2, **changes})
    return Machine(replace(configuration, loop=loop, limits=limits))
