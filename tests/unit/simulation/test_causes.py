"""Each cause of the simulated machine against first principles: symmetry, statics, beams, optics; never the model."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.simulation.causes.catalogue import CAUSES, build_cause, possible_causes
from compd.simulation.causes.link import LinkSag
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import NOTHING
from compd.simulation.truth.weather import REFERENCE_degC, Weather
from compd.simulation.truth.world import World
from tests.support.sampled import sampled
from tests.support.simulated import HEXAPOD, hexapod, tripod, tripod_with_tool_on_plate, wiring

WARM_K = 3.0
LONG_S = 4 * 86400.0
UM = 1e-3
PPM = 1e-6
MACHINE = Mechanism(tripod())
# At machine zero the tripod is symmetric: equal changes of all links move the tip straight down by change / COSINE.
COSINE = (MACHINE.joints0_M[0, 2] - (MACHINE.posture0[0] + MACHINE.joints_P[0] @ MACHINE.posture0[1:])[2]) / (
    MACHINE.lengths0_mm[0]
)


class WarmRoom(Weather):
    """A room that is always `WARM_K` too warm, dry and at low pressure."""

    def __init__(self) -> None:
        super().__init__(0.0, np.random.default_rng(1))

    def room_degC(self, time_s: float) -> float:
        return REFERENCE_degC + WARM_K

    def pressure_hPa(self, time_s: float) -> float:
        return 1003.25

    def humidity_pct(self, time_s: float) -> float:
        return 40.0


def ideal(cause: Cause | None, weather: Weather | None = None) -> World:
    """The tripod with this one cause and nothing else."""
    return World(tripod(), wiring(), 1, strengths=NOTHING, causes=[cause] if cause else [], weather=weather)


def cause(name: str, strength: float) -> Any:
    return build_cause(name, strength, MACHINE, seed=1)


def go(world: World, scale_mm: FloatArray, time_s: float = 10.0, travel_s: float = 1.0) -> None:
    world.advance_to(np.asarray(scale_mm, dtype=float), world.posture, time_s, travel_s)


def warmed(name: str, strength: float) -> World:
    """Everything as warm as the room, at machine zero's scale values."""
    world = ideal(cause(name, strength), WarmRoom())
    go(world, np.zeros(3), LONG_S, 0.0)
    return world


def moved_um(world: World) -> FloatArray:
    return (world.reference_tip_mm() - MACHINE.tip0_M) / UM


def test_every_cause_that_the_library_has_is_in_the_truth_and_others_besides() -> None:
    from compd.model.library import load_library

    ours = {name for name, kind in CAUSES.items() if kind.in_library}
    assert ours == set(load_library())
    assert len(CAUSES) - len(ours) >= 5
    assert all(kind.covariates for name, kind in CAUSES.items() if name not in ours)


@pytest.mark.parametrize("name", sampled(possible_causes(MACHINE), 3))
def test_without_strength_a_cause_does_nothing(name: str) -> None:
    with_it, without = ideal(cause(name, 0.0), WarmRoom()), ideal(None, WarmRoom())
    for world in (with_it, without):
        world.force_M_N = np.array([3.0, -5.0, -20.0])
        go(world, np.array([5.0, -3.0, 2.0]), 5000.0)
        go(world, np.array([2.0, 1.0, 7.0]), 3000.0)
    assert with_it.reference_tip_mm() == pytest.approx(without.reference_tip_mm(), abs=1e-10)
    shown = [[world.sense(name) for name in world.names] for world in (with_it, without)]
    assert shown[0] == pytest.approx(shown[1], abs=1e-12)


@pytest.mark.parametrize("name", sampled(possible_causes(MACHINE), 3))
def test_a_machine_that_nobody_looks_at_while_it_waits_is_the_same_afterwards(name: str) -> None:
    """To the last bit, with the noise of its gauges."""
    waiting, watched = (
        World(tripod(), wiring(), 3, causes=[cause(name, CAUSES[name].max_strength / 10)]) for _ in range(2)
    )
    waiting.wait(400.0)
    watched.advance_to(watched.scale_mm, watched.posture, 400.0, 0.0)
    for world in (waiting, watched):
        # so soon that a late gauge still shows what was before
        world.advance_to(np.array([5.0, -3.0, 2.0]), MACHINE.posture0, 0.02, 0.02)
    assert waiting.time_s == watched.time_s
    np.testing.assert_array_equal(waiting.reference_tip_mm(), watched.reference_tip_mm())
    assert {n: waiting.sense(n) for n in waiting.names} == {n: watched.sense(n) for n in watched.names}


@pytest.mark.long
@pytest.mark.parametrize("geometry", [hexapod(), tripod_with_tool_on_plate()], ids=["hexapod", "tool on plate"])
def test_other_machines_have_causes_too(geometry: Any) -> None:
    machine = Mechanism(geometry)
    wires = wiring(HEXAPOD) if machine.links == 6 else wiring()
    for name in possible_causes(machine):
        built = build_cause(name, CAUSES[name].max_strength / 10, machine, seed=2)
        world = World(geometry, wires, 1, strengths=NOTHING, causes=[built], weather=WarmRoom())
        world.force_M_N = np.array([5.0, 5.0, -20.0])
        world.advance_to(np.linspace(-2.0, 3.0, machine.links), world.posture, 3000.0, 1.0)
        assert np.all(np.isfinite(world.reference_tip_mm()))


# --- links ------------------------------------------------------------------------------------------------


def test_links_that_grow_alike_lower_the_tip() -> None:
    grown = 11.0 * PPM * WARM_K * MACHINE.lengths0_mm[0] / UM
    for name in ("link_expansion", "link_expansion_lag"):
        assert moved_um(warmed(name, 11.0)) == pytest.approx([0, 0, -grown / COSINE], abs=2e-3 * grown)


def test_a_rod_that_lags_is_at_first_shorter_than_its_tube() -> None:
    quick, late = ideal(cause("link_expansion", 11.0), WarmRoom()), ideal(cause("link_expansion_lag", 11.0), WarmRoom())
    for world in (quick, late):
        go(world, np.zeros(3), 300.0)
    assert 0.02 * moved_um(quick)[2] > moved_um(late)[2] > 0.9 * moved_um(quick)[2]


def test_a_load_from_above_is_shared_by_three_springs() -> None:
    gives = cause("link_elasticity", 1 / 25.0)
    world = ideal(gives)
    assert gives.values == pytest.approx([25.0])
    world.force_M_N = np.array([0.0, 0.0, -30.0])
    go(world, np.zeros(3))
    each_N = 30.0 / 3 / COSINE
    assert world.axial_N() == pytest.approx([each_N] * 3, rel=1e-6)
    assert moved_um(world) == pytest.approx([0, 0, -each_N / 25.0 / COSINE], abs=1e-3)


def test_a_contact_gives_less_and_less_as_hertz_says() -> None:
    contact = cause("joint_contact", 0.1)
    weight_N = 80.0 / 3 / COSINE

    def given_um(load_N: float) -> float:
        world = ideal(contact)
        world.force_M_N = np.array([0.0, 0.0, -load_N])
        go(world, np.zeros(3))
        return float(-moved_um(world)[2] * COSINE)

    loads_N = np.array([30.0, 90.0, 270.0])
    hertz = 0.1 * ((weight_N + loads_N / 3 / COSINE) ** (2 / 3) - weight_N ** (2 / 3))
    # the preload of 2 N holds the ball nearer by its own approach, 0.1 um x 2^(2/3), at most
    assert [given_um(load) for load in loads_N] == pytest.approx(hertz, abs=0.1 * 2 ** (2 / 3))
    force_N = np.array([-40.0, -1.0, 0.0, 1.0, 40.0])
    approach = contact._approach_mm(force_N)
    assert approach == pytest.approx(-approach[::-1], abs=1e-12)
    assert approach[3] / approach[4] < 1 / 40 * 6.0  # preloaded: nearly straight near zero, no vertical start


def test_sag_is_the_arc_less_the_chord_of_a_bent_beam() -> None:
    """Slope of an evenly loaded beam on two supports: q (l^3 - 6 l s^2 + 4 s^3) / (24 E I); Roark, table 8.1."""
    length, at = 400.0, np.linspace(0.0, 400.0, 4001)
    load = 3e-7  # q / (E I), 1/mm3
    slope = load / 24 * (length**3 - 6 * length * at**2 + 4 * at**3)
    shortening_mm = float(np.trapezoid(slope**2, at)) / 2
    assert shortening_mm == pytest.approx(17 / 40320 * load**2 * length**7, rel=1e-5)
    level_500_um = shortening_mm * (500.0 / length) ** 7 / UM
    sag = LinkSag(level_500_um, MACHINE, np.random.default_rng(1))
    level = SimpleNamespace(link_mm=np.full(3, length), directions_M=np.tile([1.0, 0.0, 0.0], (3, 1)))
    assert sag.link_extension_mm(level) == pytest.approx([-shortening_mm] * 3, rel=1e-6)
    upright = SimpleNamespace(link_mm=np.full(3, length), directions_M=np.tile([0.0, 0.0, -1.0], (3, 1)))
    assert sag.link_extension_mm(upright) == pytest.approx([0.0] * 3, abs=1e-15)


def test_a_link_adjusted_wrongly_is_as_if_its_scale_stood_elsewhere() -> None:
    off = cause("link_zero", 20.0)
    world, other = ideal(off), ideal(None)
    go(world, np.array([4.0, -7.0, 2.0]))
    go(other, np.array([4.0, -7.0, 2.0]) + UM * np.array(off.values))
    assert world.tip_M_mm() == pytest.approx(other.tip_M_mm(), abs=1e-9)


# --- scales ------------------------------------------------------------------------------------------------


def test_a_scale_that_is_too_long_and_one_that_grows() -> None:
    gain = cause("scale_gain", 30.0)
    scale_mm = np.array([40.0, -25.0, 60.0])
    for scale_cause, factor in (
        (gain, 1 + PPM * np.array(gain.values)),
        (cause("scale_expansion", 8.0), 1 + 8 * PPM * WARM_K),
    ):
        world, other = ideal(scale_cause, WarmRoom()), ideal(None)
        go(world, scale_mm, LONG_S)
        go(other, scale_mm * factor)
        assert world.tip_M_mm() == pytest.approx(other.tip_M_mm(), abs=3e-6)


def test_a_scale_errs_within_its_period_and_repeats() -> None:
    cyclic = cause("scale_cyclic", 0.3)
    steps = np.arange(64) * 0.020 / 64
    errors_um = np.array([cyclic.scale_extension_mm(SimpleNamespace(scale_mm=np.full(3, g))) for g in steps]) / UM
    later = [SimpleNamespace(scale_mm=np.full(3, g + 0.060)) for g in steps]
    again_um = np.array([cyclic.scale_extension_mm(inputs) for inputs in later]) / UM
    assert errors_um == pytest.approx(again_um, abs=1e-9)
    first, second = np.abs(np.fft.rfft(errors_um, axis=0)[1:3]) * 2 / len(steps)
    assert first == pytest.approx([0.3] * 3, rel=0.1)
    assert np.all(second < 0.3)
    assert np.abs(errors_um.mean(axis=0)).max() < 0.02


def test_play_is_taken_up_on_the_way() -> None:
    play = cause("backlash", 2.0)
    world = ideal(play)

    def length_mm() -> FloatArray:
        return world.link_change_mm() - world.scale_mm

    go(world, np.full(3, 5.0))
    forward = length_mm()
    go(world, np.full(3, 4.9995))  # half a micrometre back: within the play
    assert length_mm() == pytest.approx(forward + 0.0005, abs=1e-9)
    go(world, np.full(3, 4.0))
    assert (length_mm() - forward) / UM == pytest.approx(play.values, abs=1e-6)


def test_friction_builds_up_over_a_distance() -> None:
    friction = cause("friction_hysteresis", 1.5)
    world = ideal(friction)
    lag_um = []
    for scale in (80.0, 80.0 - friction.distance_mm / 8, 80.0 - friction.distance_mm, -80.0):
        go(world, np.full(3, scale))
        lag_um.append(float((world.link_change_mm() - world.scale_mm)[0]) / UM)
    assert lag_um[0] == pytest.approx(-1.5, abs=1e-6)
    assert lag_um[3] == pytest.approx(1.5, abs=1e-6)
    assert lag_um[0] < lag_um[1] < lag_um[2] < lag_um[3]


def test_a_display_shows_where_the_scale_was() -> None:
    world = ideal(cause("gauge_latency", 20.0))
    for step in range(1, 6):
        go(world, np.full(3, 0.5 * step), 0.05, 0.05)
    assert world.sense("scale_1") == pytest.approx(2.5 - 0.020 * 0.5 / 0.05, abs=1e-9)
    go(world, np.full(3, 2.5), 1.0, 0.0)
    assert world.sense("scale_1") == pytest.approx(2.5, abs=1e-12)
