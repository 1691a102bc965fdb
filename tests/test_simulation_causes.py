"""Each cause of the simulated machine against first principles: symmetry, statics, beams, optics; never the model."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compd.simulation.cause import Cause, Now
from compd.simulation.causes_link import LinkSag
from compd.simulation.causes_reference import refractivity
from compd.simulation.closure import Floats, homogeneous
from compd.simulation.frame import distances_mm
from compd.simulation.hidden import CAUSES, build, possible
from compd.simulation.mechanism import Mechanism
from compd.simulation.strengths import NOTHING
from compd.simulation.weather import REFERENCE_degC, Weather
from compd.simulation.world import World
from tests.simulated import HEXAPOD, hexapod, tripod, tripod_with_tool_on_plate, wiring

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
    return build(name, strength, MACHINE, seed=1)


def go(world: World, scale_mm: Floats, time_s: float = 10.0, travel_s: float = 1.0) -> None:
    world.carry(np.asarray(scale_mm, dtype=float), world.posture, time_s, travel_s)


def warmed(name: str, strength: float) -> World:
    """Everything as warm as the room, at machine zero's scale values."""
    world = ideal(cause(name, strength), WarmRoom())
    go(world, np.zeros(3), LONG_S, 0.0)
    return world


def moved_um(world: World) -> Floats:
    return (world.shown_mm() - MACHINE.tip0_M) / UM


def test_every_cause_that_the_library_has_is_in_the_truth_and_others_besides() -> None:
    from compd.model.effects import library

    ours = {name for name, kind in CAUSES.items() if kind.in_library}
    assert ours == set(library())
    assert len(CAUSES) - len(ours) >= 5
    assert all(kind.follows for name, kind in CAUSES.items() if name not in ours)


@pytest.mark.parametrize("name", possible(MACHINE))
def test_without_strength_a_cause_does_nothing(name: str) -> None:
    with_it, without = ideal(cause(name, 0.0), WarmRoom()), ideal(None, WarmRoom())
    for world in (with_it, without):
        world.force_M_N = np.array([3.0, -5.0, -20.0])
        go(world, np.array([5.0, -3.0, 2.0]), 5000.0)
        go(world, np.array([2.0, 1.0, 7.0]), 3000.0)
    assert with_it.shown_mm() == pytest.approx(without.shown_mm(), abs=1e-10)
    shown = [[world.sense(name) for name in world.names] for world in (with_it, without)]
    assert shown[0] == pytest.approx(shown[1], abs=1e-12)


@pytest.mark.parametrize("geometry", [hexapod(), tripod_with_tool_on_plate()], ids=["hexapod", "tool on plate"])
def test_other_machines_have_causes_too(geometry: Any) -> None:
    machine = Mechanism(geometry)
    wires = wiring(HEXAPOD) if machine.links == 6 else wiring()
    for name in possible(machine):
        one = build(name, CAUSES[name].most / 10, machine, seed=2)
        world = World(geometry, wires, 1, strengths=NOTHING, causes=[one], weather=WarmRoom())
        world.force_M_N = np.array([5.0, 5.0, -20.0])
        world.carry(np.linspace(-2.0, 3.0, machine.links), world.posture, 3000.0, 1.0)
        assert np.all(np.isfinite(world.shown_mm()))


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
    assert sag.link_mm(level) == pytest.approx([-shortening_mm] * 3, rel=1e-6)
    upright = SimpleNamespace(link_mm=np.full(3, length), directions_M=np.tile([0.0, 0.0, -1.0], (3, 1)))
    assert sag.link_mm(upright) == pytest.approx([0.0] * 3, abs=1e-15)


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
    for one, factor in ((gain, 1 + PPM * np.array(gain.values)), (cause("scale_expansion", 8.0), 1 + 8 * PPM * WARM_K)):
        world, other = ideal(one, WarmRoom()), ideal(None)
        go(world, scale_mm, LONG_S)
        go(other, scale_mm * factor)
        assert world.tip_M_mm() == pytest.approx(other.tip_M_mm(), abs=3e-6)


def test_a_scale_errs_within_its_period_and_repeats() -> None:
    cyclic = cause("scale_cyclic", 0.3)
    steps = np.arange(64) * 0.020 / 64
    errors_um = np.array([cyclic.link_mm(SimpleNamespace(scale_mm=np.full(3, g))) for g in steps]) / UM
    again_um = np.array([cyclic.link_mm(SimpleNamespace(scale_mm=np.full(3, g + 0.060))) for g in steps]) / UM
    assert errors_um == pytest.approx(again_um, abs=1e-9)
    first, second = np.abs(np.fft.rfft(errors_um, axis=0)[1:3]) * 2 / len(steps)
    assert first == pytest.approx([0.3] * 3, rel=0.1)
    assert np.all(second < 0.3)
    assert np.abs(errors_um.mean(axis=0)).max() < 0.02


def test_play_is_taken_up_on_the_way() -> None:
    play = cause("backlash", 2.0)
    world = ideal(play)

    def length_mm() -> Floats:
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


# --- gauges, joints, platform, tool ---------------------------------------------------------------------------


def test_comparators_that_show_too_much_and_rods_that_grow() -> None:
    assert cause("joint_comparator_gain", 0.2).joint_seen(np.array([4.0])) == pytest.approx([5.0])
    warm = warmed("frame_rod_expansion", 10.0)
    distances = distances_mm(MACHINE.supports0_M, MACHINE.plate0_M)
    shown = [warm.sense(name) for name in warm.names if name.startswith("frame_")]
    assert shown == pytest.approx(-10.0 * PPM * WARM_K * distances, rel=1e-6)
    assert cause("frame_comparator_gain", 0.04).frame_seen(np.full(9, 0.96), None) == pytest.approx([1.0] * 9)
    drifted = warmed("joint_comparator_drift", 0.4)
    assert drifted.sense("joint_5") == pytest.approx(0.4 * UM * WARM_K, rel=1e-6)


def test_a_platform_that_grows_hangs_lower() -> None:
    """Base joints on radius 250, platform joints on 80: what lies between is the links' lean."""
    length, grown = MACHINE.lengths0_mm[0], 80.0 * (1 + 20.0 * PPM * WARM_K)
    lower = np.sqrt(length**2 - (250.0 - grown) ** 2) - np.sqrt(length**2 - (250.0 - 80.0) ** 2)
    assert moved_um(warmed("platform_expansion", 20.0)) == pytest.approx([0, 0, -lower / UM], abs=1e-3)


def test_a_tool_that_grows_or_sits_elsewhere_or_bends() -> None:
    assert moved_um(warmed("tool_expansion", 12.0))[2] == pytest.approx(-60.0 * 12.0 * PPM * WARM_K / UM, rel=1e-6)
    offset = cause("tool_offset", 10.0)
    world = ideal(offset)
    go(world, np.zeros(3))
    assert moved_um(world) == pytest.approx(offset.values, abs=1e-6)
    world = ideal(cause("tool_bending", 0.5))
    world.force_M_N = np.array([8.0, 0.0, -10.0])
    go(world, np.zeros(3))
    assert moved_um(world) == pytest.approx([4.0, 0.0, -4.5], abs=1e-6)


@pytest.mark.parametrize("name", ["base_joint_position", "platform_joint_position", "revolute_axis_tilt"])
def test_parts_that_sit_elsewhere_still_close(name: str) -> None:
    """Links keep their lengths and stay square to their axes: with the parts where they are, not where drawn."""
    askew = cause(name, 80.0)
    world = ideal(askew)
    scale_mm = np.array([30.0, -12.0, 8.0])
    go(world, scale_mm)
    base_M, joints_P, axes_P = MACHINE.joints0_M, MACHINE.joints_P, MACHINE.axes_P
    if name == "base_joint_position":
        base_M = base_M + UM * np.array(askew.values).reshape(3, 3)
    elif name == "platform_joint_position":
        joints_P = joints_P + UM * np.array(askew.values).reshape(3, 3)
    else:
        turned = np.cross([0.0, 0.0, 1.0], axes_P) * 1e-6 * np.array(askew.values)[:, None]
        axes_P = axes_P + turned
    links_M = homogeneous(joints_P) @ world.posture - base_M
    assert np.linalg.norm(links_M, axis=1) == pytest.approx(MACHINE.lengths0_mm + scale_mm, abs=1e-9)
    assert (links_M * (axes_P @ world.posture[1:])).sum(axis=1) == pytest.approx([0.0] * 3, abs=1e-5)
    other = ideal(None)
    go(other, scale_mm)
    assert 1e-4 < np.linalg.norm(world.tip_M_mm() - other.tip_M_mm()) < 1.0


def test_runout_goes_across_the_link_where_no_comparator_looks() -> None:
    world, true = ideal(cause("joint_runout", 20.0)), ideal(None)
    go(world, np.zeros(3))
    assert moved_um(world) == pytest.approx([0.0] * 3, abs=1e-6)
    for one in (world, true):
        go(one, np.array([60.0, -30.0, 10.0]))
    assert np.abs(world.link_change_mm() - true.link_change_mm()).max() < 1e-12
    assert all(world.sense(f"joint_{k}") == 0.0 for k in range(1, 10))
    assert 0.1 < np.linalg.norm(world.tip_M_mm() - true.tip_M_mm()) / UM < 60.0


# --- reference --------------------------------------------------------------------------------------------------


def at(tip_M: Floats, plate_K: Floats | None = None, **more: Any) -> Now:
    warm = SimpleNamespace(plate_K=plate_K, room_degC=more.pop("room_degC", REFERENCE_degC))
    now: Any = SimpleNamespace(tip_M=np.asarray(tip_M), warm=warm, **more)
    return now


def test_a_plate_warm_on_top_is_a_cap() -> None:
    """Sagitta of a circle of curvature a dT / h: over the middle a dT R^2 / (2 h) above the plate points."""
    bow = cause("plate_bending", 6.0)
    plate_K = np.linspace(2.0, 0.0, 5)
    risen_um = 6.0 * PPM * 2.0 * 350.0**2 / (2 * 200.0) / UM
    assert bow.reference(at([0.0, 0.0, 190.0], plate_K)) / UM == pytest.approx([0, 0, -risen_um], rel=1e-5)
    assert bow.reference(at([0.0, 350.0, 190.0], plate_K)) / UM == pytest.approx([0, 0, 0], abs=1e-6)
    even = bow.reference(at([0.0, 0.0, 190.0], np.full(5, 2.0)))
    assert even == pytest.approx([0, 0, 0], abs=1e-12)


def test_air_as_edlen_measured_it() -> None:
    """n - 1 = 2.718e-4 in dry standard air at 633 nm and 20 degC; -0.93 ppm/K, +0.27 ppm/hPa, -0.01 ppm/pct."""
    assert refractivity(20.0, 1013.25, 0.0) == pytest.approx(2.7180e-4, abs=1e-7)
    air = refractivity(20.0, 1013.25, 50.0)
    assert refractivity(21.0, 1013.25, 50.0) - air == pytest.approx(-0.95e-6, abs=0.03e-6)
    assert refractivity(20.0, 1014.25, 50.0) - air == pytest.approx(0.268e-6, abs=0.002e-6)
    assert refractivity(20.0, 1013.25, 51.0) - air == pytest.approx(-0.0085e-6, abs=0.001e-6)
    longer = cause("reference_air_index", 1.0).reference(at([0.0, 0.0, 200.0], pressure_hPa=1023.25, humidity_pct=50.0))
    assert longer / UM == pytest.approx([0, 0, 200e3 * 2.68e-6], rel=0.02)


def test_a_stand_creeps_and_a_frame_is_laid_over_askew() -> None:
    drift = cause("reference_drift", 2.0)
    assert drift.reference(at([0, 0, 0], time_s=0.0)) == pytest.approx([0, 0, 0])
    hour_um = drift.reference(at([0, 0, 0], time_s=3600.0)) / UM
    assert hour_um == pytest.approx(drift.values, rel=0.02)
    askew = cause("reference_registration", 5.0)
    offset_um, turn_urad = np.array(askew.values).reshape(2, 3)
    place = np.array([50.0, -80.0, 190.0])
    expected_um = offset_um + np.cross(turn_urad, place) * UM
    assert askew.reference(at(place)) / UM == pytest.approx(expected_um, abs=1e-3)


# --- outside the library --------------------------------------------------------------------------------------------


def test_weather_that_the_library_does_not_know() -> None:
    drier = warmed("humidity_swelling", 0.2)
    assert moved_um(drier) == pytest.approx([0, 0, 0.2 * 10.0 / COSINE], rel=1e-4, abs=1e-6)
    lighter = warmed("air_pressure", 0.3)
    assert moved_um(lighter) == pytest.approx([0, 0, -0.3 * 10.0 / COSINE], rel=1e-4, abs=1e-6)
    assert moved_um(warmed("plate_swelling", 0.2)) == pytest.approx([0, 0, 2.0], rel=1e-4, abs=1e-6)


def test_a_blow_lasts_a_cable_pulls_on_one_side_and_a_room_breathes() -> None:
    blow = cause("collision_step", 5.0)
    assert np.all(blow.tool(at([0, 0, 0], time_s=blow.hit_s - 1)) == 0.0)
    assert blow.tool(at([0, 0, 0], time_s=blow.hit_s + 1)) / UM == pytest.approx(blow.values)
    cable = cause("cable_drag", 4.0)
    x = MACHINE.tip0_M[0]
    pulled = [cable.tool(at([x + away, 0.0, 190.0]))[0] / UM for away in (-50.0, 10.0, 60.0, 110.0)]
    assert pulled == pytest.approx([0.0, 0.0, -2.0, -4.0])
    room = cause("room_breathing", 1.0)
    waves = [room.reference(at([0, 0, 0], time_s=time_s))[2] for time_s in (100.0, 100.0 + room.period_s)]
    assert waves[0] == pytest.approx(waves[1], abs=1e-12)
