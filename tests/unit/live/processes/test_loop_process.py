"""A loop that takes over goes on where the last one ended, to the bit; with other models if it is asked to."""

from __future__ import annotations

from dataclasses import replace

import pytest

from compd.gauge import Quality
from compd.live.loop.adopted_models import AdoptedModels
from compd.live.loop.ring_entries import CyclePacker, Directions
from compd.live.loop.timing import LoopTiming
from compd.live.machine.model_loader import Models, ModelText
from compd.live.memory.control import Control
from compd.live.memory.shared_ring import SharedRing
from compd.live.processes.loop_process import LoopProcess, ModelChange
from compd.live.system import THIS_COMPUTER
from compd.setpoint_states import State
from tests.support.live_machine import STEP_MM, machine
from tests.support.live_models import file_with


class Predecessor:
    """A machine whose cycles go into the ring, and the process that would take over from them."""

    def __init__(self, **changes):
        self.machine = machine(**changes)
        self.cycles, self.setpoints, self.control = SharedRing(), SharedRing(), Control()
        self.packer = CyclePacker(Directions(self.machine.wires.scale.wires))
        self.machine.commands.models = Models(self.machine.loader.without_effects)
        self.adopted = AdoptedModels(self.machine.commands.models)
        self.process = LoopProcess(
            self.machine.settings,
            self.machine.latest,
            self.machine.commands,
            self.machine.loader,
            self.adopted,
            LoopTiming(self.machine.settings.period_s),
            self.setpoints,
            self.cycles,
            None,
            self.control,
            THIS_COMPUTER,
        )

    def step(self):
        setpoint = self.machine.step()
        self.cycles.put(setpoint.time_s, setpoint.state.code, self.packer.pack(setpoint, setpoint.to_json()))
        return setpoint

    def use(self, models):
        self.machine.commands.models = models
        self.adopted.write(models)

    def left(self, forget=False):
        return self.process._state_left(self.machine.commands.models, forget)

    def close(self):
        self.cycles.close()
        self.setpoints.close()
        self.control.close()


@pytest.fixture
def predecessor():
    made = Predecessor()
    yield made
    made.close()


def test_without_a_cycle_before_it_a_loop_begins_at_machine_zero(predecessor):
    state = predecessor.left()
    assert state.correction_mm.tolist() == [0.0, 0.0, 0.0]
    assert state.zero is None


@pytest.mark.parametrize("effects", [False, True], ids=["no effects", "effects that remember"])
def test_a_loop_that_takes_over_computes_what_the_other_would_have(predecessor, tmp_path, effects):
    live = predecessor.machine
    if effects:
        file = file_with(tmp_path / "m.yaml", "link_expansion_lag", "backlash", backlash=[20, 30, 40])
        predecessor.use(Models(live.loader.read(file)))
    for tick in range(60):
        live.change_mm["joints.1"] = 0.02 if tick > 20 else 0.0
        live.change_mm["scale_1.position"] = 0.01 * (tick % 20)
        live.faults = {"joints.2": Quality.TIMEOUT} if 30 < tick < 40 else {}
        predecessor.step()
        left, kept = predecessor.left(), live.state
        now_s, number = live.now_s, live.tick
        live.state = left
        taken_over = live.step().to_json()
        live.state, live.now_s, live.tick = kept, now_s, number
        assert live.step().to_json() == taken_over, tick
        live.state, live.now_s, live.tick = kept, now_s, number


def test_a_state_that_is_to_be_forgotten_leaves_the_correction_from_which_the_next_one_slews(predecessor):
    predecessor.machine.settle()
    predecessor.step()
    live = predecessor.machine
    live.change_mm["joints.1"] = 0.2
    for _ in range(3):
        before = predecessor.step()
    state = predecessor.left(forget=True)
    live.state = state
    after = live.step()
    assert after.state is State.SLEWING
    change_mm = after.values.correction_mm - before.values.correction_mm
    assert abs(change_mm).max() <= 2 * STEP_MM + 1e-9


def test_a_last_cycle_that_cannot_be_computed_again_does_not_end_the_next_loop(predecessor, monkeypatch):
    predecessor.step()

    def failing(*_):
        raise RuntimeError("an effect of a user's own")

    monkeypatch.setattr("compd.live.processes.loop_process.step", failing)
    assert predecessor.left().correction_mm.tolist() == [0.0, 0.0, 0.0]


def test_a_model_that_is_refused_is_answered_and_leaves_the_turn_where_it_is(predecessor):
    process, control = predecessor.process, predecessor.control
    control.give_turn(1)
    process.run_successor(2, ModelChange(7, ModelText("/none.yaml", b"no model"), False))
    number, summary, refusal = control.model_answer.read()
    assert (number, summary) == (7, None)
    assert "/none.yaml" in refusal
    assert control.turn == 1
    assert control.successor == 0


def test_a_successor_takes_the_turn_between_two_ticks_and_tells_its_models(predecessor, tmp_path):
    process, control = predecessor.process, predecessor.control
    predecessor.step()
    control.give_turn(2)  # as the loop does that has it: the successor's number is written before it is asked for
    file = file_with(tmp_path / "m.yaml", "link_zero")

    class Once(LoopTiming):
        def note_end(self, *arguments, **keywords):
            super().note_end(*arguments, **keywords)
            control.give_turn(3)

    process = replace(process, timing=Once(process.settings.period_s))
    process.run_successor(2, ModelChange(1, ModelText.read(file), False))
    number, summary, refusal = control.model_answer.read()
    assert (number, refusal) == (1, "")
    assert summary["applied"]["effects"] == ["link_zero"]
    assert predecessor.adopted.summary == summary
    assert predecessor.setpoints.count == 1
    file.unlink()
    again = predecessor.adopted.load(predecessor.machine.loader)
    assert again.applied.hash == summary["applied"]["model"], "the loop after it needs no file"
