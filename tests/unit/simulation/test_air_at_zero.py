"""The simulated machine is at its machine zero at any temperature and in any air."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from compd.cli.simulated.sim.campaign import campaign
from compd.cli.simulated.sim.run import run as simulate
from compd.configuration import load, shipped_configuration
from compd.simulation.causes.catalogue import CAUSES, build_cause, possible_causes
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import FULLY_MEASURED_WITHOUT_NOISE
from compd.simulation.truth.weather import STANDARD_AIR, AirAtZero, REFERENCE_degC
from compd.simulation.truth.world import World

MACHINES = pytest.mark.parametrize("name", ["tripod-cmm.yaml", "hexapod.yaml"])
SHOP = AirAtZero(23.0, 960.0, 35.0)
# What is there at machine zero whatever the weather; and the instrument, which stands there before or does not know it.
CONSTANT = {
    *("link_zero", "base_joint_position", "platform_joint_position", "tool_offset", "revolute_axis_tilt"),
    *("link_sag", "scale_cyclic", "reference_registration", "reference_air_index"),
}


@pytest.mark.parametrize("command", [simulate, campaign])
def test_zero_is_taken_at_the_reference_temperature_unless_told_otherwise(command: Callable[..., None]) -> None:
    """The commands state it as a number of their own: to import the simulation for it would slow every `--help`."""
    assert inspect.signature(command).parameters["zero_degC"].default == STANDARD_AIR.temperature_degC == REFERENCE_degC


load_machine = cache(lambda name: load(shipped_configuration(name)))


def world(name: str, air: AirAtZero, causes: Sequence[Cause] = ()) -> World:
    configuration = load_machine(name)
    strengths = replace(FULLY_MEASURED_WITHOUT_NOISE, room_swing_K=0.0)
    return World(configuration.geometry, configuration.wiring, 1, strengths=strengths, causes=causes, air_at_zero=air)


@MACHINES
@pytest.mark.parametrize("degC", [15.0, 20.0, 23.0, 27.0])
def test_at_machine_zero_every_length_reads_0_and_every_thermometer_its_temperature(name: str, degC: float) -> None:
    machine = world(name, AirAtZero(degC, 960.0, 35.0))
    for gauge in machine.names:
        shown = machine.sense(gauge)
        expected = degC if gauge.startswith("temperature") else {"pressure_hPa": 960.0, "humidity_pct": 35.0}.get(gauge)
        assert shown == pytest.approx(expected or 0.0, abs=1e-9), gauge
    assert machine.tip_M_mm() == pytest.approx(world(name, AirAtZero()).tip_M_mm(), abs=1e-12)


@MACHINES
def test_no_cause_that_follows_the_weather_does_anything_there(name: str) -> None:
    mechanism = Mechanism(load_machine(name).geometry)
    of_weather = [cause for cause in possible_causes(mechanism) if cause not in CONSTANT]
    causes = [build_cause(cause, 0.2 * CAUSES[cause].max_strength, mechanism, 1) for cause in of_weather]
    assert {"link_expansion", "link_expansion_lag", "humidity_swelling", "air_pressure"} <= set(of_weather)
    machine = world(name, SHOP, causes)
    assert machine.reference_tip_mm() == pytest.approx(world(name, SHOP).reference_tip_mm(), abs=1e-9)
    gauges = [machine.sense(gauge) for gauge in machine.names if gauge.startswith(("scale", "joint", "frame"))]
    assert np.abs(gauges).max() < 1e-9


@MACHINES
def test_the_machine_warms_up_alike_from_any_temperature(name: str) -> None:
    cold, warm = world(name, AirAtZero(15.0)), world(name, AirAtZero(27.0))
    for machine in (cold, warm):
        machine.start_tour()
        machine.advance(1800.0)
    for gauge in cold.names:
        difference = warm.sense(gauge) - cold.sense(gauge)
        expected = 12.0 if gauge.startswith("temperature") else 0.0
        assert difference == pytest.approx(expected, abs=1e-7), gauge


@MACHINES
def test_a_scale_was_ruled_at_20_degC(name: str) -> None:
    mechanism = Mechanism(load_machine(name).geometry)
    ppm_per_K, scale_mm = 10.0, np.full(mechanism.links, 30.0)
    machine = world(name, SHOP, [build_cause("scale_expansion", ppm_per_K, mechanism, 1)])
    plain = world(name, SHOP)
    for each in (machine, plain):
        each.advance_to(scale_mm, each.posture, 1e-3, 1e-3)
    grown_mm = machine.link_change_mm() - plain.link_change_mm()
    assert grown_mm == pytest.approx(ppm_per_K * 1e-6 * 30.0 * 3.0, rel=1e-3)
