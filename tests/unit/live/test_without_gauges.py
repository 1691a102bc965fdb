"""A machine without any gauge, live: the commanded pose is corrected by the model's effects alone."""

from __future__ import annotations

import numpy as np
import pytest

from compd.configuration import load
from compd.live.loop import Target
from compd.live.machine import Models
from compd.rotation import rotation_matrix
from compd.setpoint_states import State
from tests.support.bare_machines import bare_machine
from tests.support.live_machine import Machine
from tests.support.live_models import file_with
from tests.support.model_machines import inverse_pose
from tests.unit.live.test_daemon import configuration, first, running

TIPS_B0_mm = {"6-ups": (20.0, -10.0, 500.0), "3-spr": (10.0, 5.0, 520.0), "linear-delta": (15.0, 0.0, -340.0)}
LINKS = {"6-ups": 6, "3-spr": 3, "linear-delta": 6}
# Links that are longer than drawn.
LONGER = 1e-4
LENGTHENED = {
    "id": "lengthened",
    "physics": "the links are longer than drawn",
    "port": "link",
    "formula": "k * link_mm",
    "parameters": {"k": {"unit": "um/mm", "plausible": [-1, 1], "source": "a guess"}},
}


def lengthened(kind, tmp_path):
    return file_with(tmp_path / "m.yaml", LENGTHENED, name=kind, links=LINKS[kind], lengthened=1e3 * LONGER)


def drawn_lengths_mm(model, tip_mm, rotation_M_P):
    """(n,) mm: by the drawing, with the tip there."""
    mechanism = model.mechanism(model.zero.base_joints_M_mm)
    return inverse_pose(model, mechanism, tip_mm, model.zero.contact.tip_P_mm, rotation_M_P).link_length_mm


@pytest.mark.parametrize("kind", ["6-ups", "3-spr"])
def test_the_corrected_pose_makes_up_for_what_the_model_says_of_the_links(kind, tmp_path):
    live = Machine(load(bare_machine(kind, tmp_path)))
    live.commands.models = Models(live.loader.read(lengthened(kind, tmp_path)))
    live.commands.target = Target(TIPS_B0_mm[kind])
    setpoint = live.settle()
    assert not setpoint.values.scale_setpoint_mm.size
    attitude = rotation_matrix(setpoint.values.rotation_M_rad)
    correction = setpoint.values.pose_correction
    asked_mm = drawn_lengths_mm(live.model, setpoint.values.tip_M_mm, attitude)
    told_mm = drawn_lengths_mm(
        live.model, setpoint.values.tip_M_mm + correction[:3], rotation_matrix(correction[3:]) @ attitude
    )
    assert np.linalg.norm(correction[:3]) > 0.02
    assert told_mm * (1 + LONGER) == pytest.approx(asked_mm, abs=2e-5)


@pytest.mark.parametrize("kind", TIPS_B0_mm)
def test_the_daemon_runs_without_gauges_and_nobody_takes_machine_zero(kind, tmp_path):
    configured = configuration(tmp_path, bare_machine(kind, tmp_path, wiring={"frame_drift_um": 20}))
    with running(configured) as (_, client):
        status = client.status()
        assert status["zero"]["taken"]
        assert (status["gauges"], status["lines"]) == ([], {})
        assert "the scales: the pose that a controller commands is corrected" in client.version["not_measured"]
        assert "there are no scales" in first(client.watch(), "refused")["reason"]
        client.target(TIPS_B0_mm[kind], id=1)
        setpoint = next(s for s in client.watch() if s.get("target_id") == 1)
        assert (setpoint["valid"], setpoint["state"], setpoint["mode"]) == (True, "ok", "machine_tool")
        assert setpoint["tip_B0_mm"] == pytest.approx(TIPS_B0_mm[kind])
        assert setpoint["tip_correction_mm"] == pytest.approx([0, 0, 0], abs=1e-9)
        assert setpoint["u_tip_um"] == pytest.approx(20 * np.sqrt(3 * 2.6049), rel=1e-3)
        client.model(str(lengthened(kind, tmp_path)))
        client.target(TIPS_B0_mm[kind], id=2)
        corrected = next(s for s in client.watch() if "lengthened" in s.get("sources_mm", {}) and s["state"] == "ok")
        assert np.linalg.norm(corrected["tip_correction_mm"]) > 0.02
        budget = client.budget()
        assert np.linalg.norm(budget["tip_um"]["lengthened"]) > 20.0
        assert client.accept("all")["gauges"] == []
    with running(configured) as (_, client):
        assert client.status()["zero"] == status["zero"], "it is kept"


def test_a_target_that_grows_old_stops_a_machine_without_gauges(tmp_path):
    live = Machine(load(bare_machine("6-pus", tmp_path)))
    live.commands.target = Target((0.0, 0.0, 480.0), valid_until_s=live.now_s + 0.02)
    assert live.step().state is State.OK
    assert [live.step().state for _ in range(5)][-1] is State.STOP
