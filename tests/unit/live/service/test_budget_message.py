"""BUDGET: each cause at the tip, against the tip that the kinematics finds with and without the comparators."""

from __future__ import annotations

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.configuration import load
from compd.live.loop import Target
from compd.live.machine.model_loader import Models
from compd.live.service.budget_message import BudgetMessage
from compd.rotation import rotation_matrix
from tests.support.bare_machines import bare_machine
from tests.support.live_machine import Machine, machine
from tests.support.live_models import file_with, thermal

LINKS = {"tripod-cmm.yaml": 3, "hexapod.yaml": 6}


def budget_of(live, setpoint):
    return BudgetMessage(live.model, setpoint.to_json).message()


def displaced(name):
    """A machine away from zero, whose joints have run out by up to 2 um and whose frame has moved by up to 10 um."""
    live = machine(name)
    random = np.random.default_rng(3)
    for wires, size_mm in ((live.wires.scale, 15.0), (live.wires.joint, 2e-3), (live.wires.frame, 10e-3)):
        for wire in wires.wires:
            live.change_mm[wire.channel] = float(random.uniform(-size_mm, size_mm))
    return live, live.settle()


@pytest.mark.parametrize("name", LINKS)
def test_the_causes_add_up_to_what_the_scales_alone_are_wrong_by(name):
    live, setpoint = displaced(name)
    budget = budget_of(live, setpoint)
    assert list(budget["tip_um"]) == ["joints", "frame"]
    scale_mm = setpoint.values.scale_setpoint_mm - setpoint.values.correction_mm
    alone = GaugeValues(scale_mm, np.zeros(live.wires.joints), np.zeros(9), {}, 0.0)
    believed, _ = compensate_cmm(live.model, alone, WarmStart.at_zero(live.model))
    wrong_um = 1e3 * (setpoint.values.tip_M_mm - believed.tip_M_mm)
    assert np.linalg.norm(wrong_um) > 5.0
    assert sum(map(np.array, budget["tip_um"].values())) == pytest.approx(wrong_um, abs=0.01)


@pytest.mark.parametrize("name", LINKS)
def test_the_machine_can_be_drawn_from_it(name):
    """Between the joints are the links, and the tool's tip on the platform is where the setpoint has it."""
    live, setpoint = displaced(name)
    budget = budget_of(live, setpoint)
    base, platform = np.array(budget["base_joints_M_mm"]), budget["platform"]
    lengths_mm = np.linalg.norm(np.array(platform["joints_M_mm"]) - base, axis=1)
    # the frame bends a little, and is drawn as stiff
    assert lengths_mm == pytest.approx(setpoint.values.link_length_mm, abs=0.05)
    tool_P_mm = np.array(live.configuration.geometry.tool.at_P_mm)
    tip_M_mm = platform["origin_M_mm"] + rotation_matrix(np.array(platform["rotation_M_rad"])) @ tool_P_mm
    assert tip_M_mm == pytest.approx(setpoint.values.tip_M_mm, abs=0.05)


@pytest.mark.parametrize("name", LINKS)
def test_the_shadow_at_the_tip_is_what_its_model_would_be_there_if_it_were_applied(name, tmp_path):
    live, _ = displaced(name)
    placeholders = {"name": live.configuration.machine, "links": LINKS[name], "link_zero": 20.0}
    model = live.loader.read(file_with(tmp_path / "a.yaml", "link_zero", **placeholders))
    live.commands.models = Models(live.loader.without_effects, model)
    shadow_um = budget_of(live, live.settle())["shadow_tip_um"]
    live.commands.models = Models(model)
    applied = budget_of(live, live.settle())
    assert "shadow_tip_um" not in applied
    assert np.linalg.norm(applied["tip_um"]["link_zero"]) > 5.0
    assert shadow_um == pytest.approx(sum(map(np.array, applied["tip_um"].values())), abs=0.05)


def test_a_shadow_without_numbers_has_none_at_the_tip(tmp_path):
    live = machine()
    live.commands.models = Models(live.loader.without_effects, thermal(live, tmp_path).applied)
    assert "shadow_tip_um" in budget_of(live, live.settle())
    live.faults["cabinet.link_1"] = "timeout"
    assert "shadow_tip_um" not in budget_of(live, live.step())


def test_without_a_valid_setpoint_there_is_no_number():
    live = machine()
    live.faults = dict.fromkeys(live.latest.channels, "timeout")
    setpoint = live.step()
    budget = budget_of(live, setpoint)
    assert not budget["valid"]
    assert budget["reason"] == setpoint.reason
    assert not {"tip_um", "platform"} & set(budget)
    before_the_first = BudgetMessage(live.model, lambda: None).message()
    assert (before_the_first["valid"], bool(before_the_first["reason"])) == (False, True)


@pytest.mark.parametrize("kind", ["6-ups", "rotary-delta"])
def test_where_the_pose_is_corrected_the_causes_are_those_of_the_tip(kind, tmp_path):
    live = Machine(load(bare_machine(kind, tmp_path)))
    live.commands.models = Models(live.loader.read(file_with(tmp_path / "a.yaml", "link_zero", name=kind, links=6)))
    live.commands.target = Target(tuple(live.model.zero.contact.tip_M_mm.tolist()))
    setpoint = live.settle()
    budget = budget_of(live, setpoint)
    assert list(budget["tip_um"]) == ["joints", "frame", "link_zero"]
    assert np.linalg.norm(budget["tip_um"]["link_zero"]) > 0.5
    assert budget["tip_um"]["link_zero"] == pytest.approx(-1e3 * setpoint.values.pose_correction[:3], abs=0.01)
