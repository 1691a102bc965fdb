"""The tip's uncertainty by noise in the live loop: of gauges and parameters, and the radius in which the tip is."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from compd.compensation import GaugeValues, WarmStart, compensate_cmm
from compd.configuration import load
from compd.gauge import ReadingMotion
from compd.live.loop.tip_uncertainty import radius_95
from compd.live.machine.model_loader import Models
from compd.setpoint_states import State
from tests.support.live_machine import Machine, machine
from tests.support.live_models import file_with, thermal, with_noise

MACHINES = pytest.mark.parametrize(("name", "links"), [("tripod-cmm.yaml", 3), ("hexapod.yaml", 6)])
BOTH = pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])


def told(setpoint):
    return json.loads(setpoint.to_json()).get("u_tip_um")


@BOTH
def test_a_shipped_machine_tells_the_bound_in_every_valid_setpoint(name):
    live = machine(name)
    assert 0.1 < told(live.settle()) < 1.0
    live.faults["scale_1.position"] = "timeout"
    assert "u_tip_um" not in json.loads(live.step().to_json())


@BOTH
def test_without_stated_noise_the_bound_is_absent_and_with_a_limit_refused_by_name(name):
    live = with_noise(machine(name), None)
    setpoint = live.step()
    assert setpoint.valid
    assert "u_tip_um" not in json.loads(setpoint.to_json())
    refused = with_noise(machine(name), None, tip_error_um=100.0).step()
    assert (refused.valid, refused.state) == (False, State.REFUSED)
    assert "nobody states how much scale_1, scale_2, scale_3 and" in refused.reason
    assert "`noise_um`" in refused.reason


@BOTH
def test_a_length_that_scatters_by_far_more_than_is_stated_counts_as_it_scatters(name):
    stated, scatters = machine(name), machine(name)
    wanted = with_noise(machine(name), 0.3)  # all scales, joints and frame, ten times as much
    put = scatters.latest.put
    shown_mm = dict.fromkeys(scatters.wires.length_channels, 0.3e-3)

    def with_scatter(slot, reading):
        still = ReadingMotion(0.0, 0.0, 0.0, 0.1, due_s=1.0, rest_s=10.0, scatter_mm=math.nan)
        channel = next(name for name, number in scatters.latest.index.items() if number == slot)
        if reading.ok and channel in shown_mm:
            reading = reading._replace(motion=still._replace(scatter_mm=shown_mm[channel]))
        put(slot, reading)

    scatters.latest.put = with_scatter
    assert told(scatters.settle()) == pytest.approx(told(wanted.settle()), rel=1e-3)
    for _ in range(7):  # it is not looked at by chance
        scatters.step()
    shown_mm = dict.fromkeys(scatters.wires.length_channels, 3e-3)
    begins = scatters.step()
    assert told(begins) == pytest.approx(told(with_noise(machine(name), 3.0).settle()), rel=1e-3)
    shown_mm = {
        channel: 1.5 * wire.noise.um * 1e-3 for channel, wire in zip(shown_mm, scatters.wires.length_wires, strict=True)
    }
    for _ in range(300):  # until the noise is looked at again
        setpoint = scatters.step()
    assert told(setpoint) == pytest.approx(told(stated.settle()), rel=1e-3)


def test_noise_moves_no_machine_zero():
    tripod = machine()
    assert with_noise(tripod, 0.1).configuration.zero_hash == tripod.configuration.zero_hash
    assert with_noise(tripod, 0.1).configuration.config_hash != tripod.configuration.config_hash


@MACHINES
def test_the_uncertainty_is_that_of_gauges_and_parameters_changed_one_by_one(tmp_path, name, links):
    live = with_noise(machine(name), 0.2)
    machine_name = live.configuration.machine
    live.change_mm |= {channel: 0.003 * (k % 3) for k, channel in enumerate(live.wires.length_channels)}
    live.settle()
    gauges_alone = live.state.tip_noise_um
    file = file_with(tmp_path / "m.yaml", "link_zero", "tool_offset", name=machine_name, links=links)
    model = live.loader.read(file)
    live.commands.models = Models(model)
    live.settle()
    by_noise_um = live.state.tip_noise_um

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

    def covariance(places, step, sigma):
        moved = [(tip_um(at, step) - tip_um(at, -step)) / (2 * step) * sigma for at in places]
        return sum(np.outer(each, each) for each in moved)

    # a length is the difference of two readings: now and at machine zero
    gauges = covariance(range(len(live.wires.length_channels)), 1e-3, np.sqrt(2) * 0.2e-3)
    places = [(e, k) for e, fitted in enumerate(model.machine.effects) for k in range(len(fitted.theta))]
    parameters = covariance(places, 1.0, 0.1)
    for by_um, expected in ((gauges_alone, gauges), (by_noise_um, gauges + parameters)):
        assert by_um[:3] == pytest.approx(np.sqrt(np.diag(expected)), rel=1e-3)
        assert by_um[3] == pytest.approx(radius_95(expected), rel=1e-3)
    assert told(live.step()) == pytest.approx(by_noise_um[3], rel=1e-3)


@pytest.mark.parametrize(
    "sigmas", [(1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (1.0, 0.6, 0.3), (1.0, 0.2, 0.2)]
)
def test_the_sphere_holds_95_per_cent(sigmas):
    rng = np.random.default_rng(5)
    turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    errors = rng.normal(size=(200_000, 3)) * sigmas @ turned.T
    radius = radius_95(turned @ np.diag(np.square(sigmas)) @ turned.T)
    assert np.mean(np.linalg.norm(errors, axis=1) <= radius) == pytest.approx(0.95, abs=0.004)


@BOTH
def test_what_is_not_known_of_an_effect_leaves_the_bound_unknown_and_is_named(tmp_path, name):
    live = with_noise(machine(name), 0.2)
    limited = with_noise(machine(name), 0.2, tip_error_um=100.0)
    links = live.model.links
    file = file_with(
        tmp_path / "thermal.yaml", "link_expansion", name=live.configuration.machine, links=links, link_expansion=10.0
    )
    for each in (live, limited):
        each.commands.models = Models(each.loader.read(file))
    assert told(live.settle()) is None, "no noise is stated for the thermometers"
    reason = limited.step().reason
    assert "nobody states how much temperature_link_1_degC" in reason
    assert "`noise`" in reason


def test_errors_of_fitted_numbers_that_are_not_known_are_named(tmp_path):
    tripod = machine()
    tripod.commands.models = thermal(tripod, tmp_path)
    assert told(tripod.settle()) > 0.4
    unsure = tripod.commands.models.applied
    unknown = replace(unsure.machine, covariance=np.full((1, 1), np.nan))
    tripod.commands.models = Models(replace(unsure, machine=unknown))
    assert "the errors of its fitted numbers" in tripod.step().reason


def test_the_data_sheet_of_a_driver_counts_where_the_configuration_says_nothing(tmp_path):
    file = tmp_path / "sheet.py"
    file.write_text(
        "from compd.gauge import DataSheetNoise\n"
        "from compd_drivers.heidenhain_nd28x import HeidenhainNd28x\n"
        "class Sheet(HeidenhainNd28x):\n"
        "    noise = DataSheetNoise(0.05, 'data sheet 1234, page 5')\n"
    )
    text = machine().configuration.path.read_text()
    text = text.replace("driver: heidenhain_nd28x, line: scale_1", f"driver: '{file}:Sheet', line: scale_1")
    own, sheet = tmp_path / "own.yaml", tmp_path / "sheet.yaml"
    own.write_text(text)
    sheet.write_text(text.replace(", noise_um: 0.03", "", 1))
    assert load(own).noise_of("scale_1.position") == (0.03, "configuration")
    assert load(sheet).noise_of("scale_1.position") == (0.05, "driver: data sheet 1234, page 5")
    assert told(Machine(load(sheet)).settle()) > told(Machine(load(own)).settle())
