"""The uncertainty of the tip in the live loop: of gauges and parameters, or not told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from compd.compensation.compensation import compensate_cmm
from compd.compensation.values import GaugeValues, WarmStart
from compd.live.loop.model_loader import Models
from tests.support.live_machine import Machine, machine
from tests.support.live_models import file_with, thermal, with_noise


def test_without_declared_noise_the_uncertainty_is_absent():
    tripod = machine()
    assert tripod.step().values.u_tip_um is None
    assert b"u_tip_um" not in tripod.step().to_json()


def test_noise_moves_no_machine_zero():
    tripod = machine()
    assert with_noise(tripod, 0.1).configuration.zero_hash == tripod.configuration.zero_hash
    assert with_noise(tripod, 0.1).configuration.config_hash != tripod.configuration.config_hash


@pytest.mark.parametrize(("name", "links"), [("tripod-cmm.yaml", 3), ("hexapod.yaml", 6)])
def test_the_uncertainty_is_that_of_gauges_and_parameters_changed_one_by_one(tmp_path, name, links):
    live = with_noise(machine(name), 0.2)
    machine_name = live.configuration.machine
    live.change_mm |= {channel: 0.003 * (k % 3) for k, channel in enumerate(live.wires.length_channels)}
    gauges_alone = live.settle().values.u_tip_um
    file = file_with(tmp_path / "m.yaml", "link_zero", "tool_offset", name=machine_name, links=links)
    model = live.loader.read(file)
    live.commands.models = Models(model)
    u_tip_um = live.settle().values.u_tip_um

    def tip_um(at, step):
        values = {"scale_mm": np.zeros(links), "joint_mm": np.zeros(live.wires.joints), "frame_mm": np.zeros(9)}
        for k, channel in enumerate(live.wires.length_channels):
            place = np.cumsum([links, live.wires.joints])
            kind = ("scale_mm", "joint_mm", "frame_mm")[int(np.searchsorted(place, k, side="right"))]
            first_ = {"scale_mm": 0, "joint_mm": place[0], "frame_mm": place[1]}[kind]
            values[kind][k - first_] = live.change_mm[channel] + (step if at == k else 0.0)
        changed = model.machine
        if isinstance(at, tuple):
            fitted = changed.effects[at[0]]
            theta = fitted.theta + step * (np.arange(len(fitted.theta)) == at[1])
            effects = [replace(effect, theta=theta) if effect is fitted else effect for effect in changed.effects]
            changed = replace(changed, effects=tuple(effects))
        compensation, _ = compensate_cmm(changed, GaugeValues(**values, quantities={}), WarmStart.at_zero(changed))
        return compensation.tip_M_mm * 1e3

    def variance(places, step, sigma):
        return sum(((tip_um(at, step) - tip_um(at, -step)) / (2 * step) * sigma) ** 2 for at in places)

    gauges = variance(range(len(live.wires.length_channels)), 1e-3, 0.2e-3)
    places = [(e, k) for e, fitted in enumerate(model.machine.effects) for k in range(len(fitted.theta))]
    parameters = variance(places, 1.0, 0.1)
    assert gauges_alone == pytest.approx(np.sqrt(gauges), rel=1e-3)
    assert u_tip_um == pytest.approx(np.sqrt(gauges + parameters), rel=1e-3)
    assert live.step().to_json().count(b'"u_tip_um":[') == 1


def test_what_is_not_known_makes_the_tip_uncertain_without_a_number(tmp_path):
    live = with_noise(machine(), 0.2)
    live.commands.models = thermal(live, tmp_path)
    assert np.isnan(live.settle().values.u_tip_um).all(), "no noise is declared for the thermometers"
    assert b"u_tip_um" not in live.step().to_json()
    loaded = live.configuration
    quantities = tuple(q.model_copy(update={"noise": 0.02}) for q in loaded.wiring.quantities)
    known = Machine(replace(loaded, wiring=loaded.wiring.model_copy(update={"quantities": quantities})))
    known.commands.models = thermal(known, tmp_path)
    assert np.isfinite(known.settle().values.u_tip_um).all()
    unsure = known.commands.models.applied
    unknown = replace(unsure.machine, covariance=np.full((1, 1), np.nan))
    known.commands.models = Models(replace(unsure, machine=unknown))
    assert np.isnan(known.settle().values.u_tip_um).all()
