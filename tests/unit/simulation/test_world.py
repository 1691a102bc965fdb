"""The simulated machine as a whole: conventions, truth, determinism."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.optimize import least_squares

from compd.arrays import FloatArray
from compd.configuration import Geometry
from compd.errors import CompdError
from compd.operation_settings import Wiring
from compd.simulation.truth.closure import homogeneous
from compd.simulation.truth.frame import DISTANCES, distances_mm
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.motion import ACCELERATION_MM_PER_S2, SPEED_MM_PER_S
from compd.simulation.truth.strengths import FULLY_MEASURED_WITHOUT_NOISE, NOTHING
from compd.simulation.truth.world import World
from tests.support.sampled import sampled
from tests.support.simulated import HEXAPOD, hexapod, tripod, tripod_with_tool_on_plate, wiring

MACHINES = [(tripod(), wiring()), (hexapod(), wiring(HEXAPOD))]
ROLE_WEIGHT = {"S": 1.0, "B": 1.0, "Ra": 0.5, "Rb": 0.5}
# Figures 14 and 15: the base under or beside the work, the work on the moving platform.
OTHERS = [
    (tripod((np.pi, 0.0, 0.0)), wiring()),
    (tripod((0.0, np.pi / 2, 0.0)), wiring()),
    (tripod_with_tool_on_plate(), wiring()),
]

IDS = ["tripod", "hexapod", "under", "beside", "tool on plate"]
arrangements = pytest.mark.parametrize(("geometry", "wires"), MACHINES + OTHERS, ids=IDS)
machines = pytest.mark.parametrize(("geometry", "wires"), MACHINES, ids=["tripod", "hexapod"])


def run(world: World, time_s: float, step_s: float = 0.1) -> None:
    for _ in range(round(time_s / step_s)):
        world.advance(step_s)


def scale_mm(world: World) -> FloatArray:
    return np.array([world.sense(f"scale_{i + 1}") for i in range(len(world.scale_mm))])


def compensated_tip(world: World, geometry: Geometry, wires: Wiring) -> FloatArray:
    """The tip in {M} by the paper's equations (1) and (3) from nothing but the gauges."""
    machine = Mechanism(geometry)
    lengths_mm = machine.lengths0_mm + scale_mm(world)
    for k, wire in enumerate(wires.joint):
        lengths_mm[wire.link - 1] -= ROLE_WEIGHT[wire.role] * world.sense(f"joint_{k + 1}")
    wanted = distances_mm(machine.supports0_M, machine.plate0_M)
    wanted = wanted + [world.sense(f"frame_{name}") for name in DISTANCES]
    supports_M = least_squares(
        lambda b: distances_mm(b.reshape(3, 3), machine.plate0_M) - wanted,
        machine.supports0_M.ravel(),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    ).x.reshape(3, 3)
    posture = machine.closure.by_lengths(
        machine.base_joints_M(supports_M), machine.joints_P, lengths_mm, machine.posture0
    )
    return tip_in(machine, posture)


def tip_in(machine: Mechanism, posture: FloatArray) -> FloatArray:
    """The tip in {M}; with the tool on the plate, the place on the work in {P}."""
    if machine.tip_frame == "M":
        return np.asarray(homogeneous(machine.tip0_P) @ posture)
    return np.asarray(posture[1:] @ (machine.tip0_M - posture[0]))


def nominal_tip(world: World, geometry: Geometry) -> FloatArray:
    machine = Mechanism(geometry)
    posture = machine.closure.by_lengths(
        machine.joints0_M, machine.joints_P, machine.lengths0_mm + scale_mm(world), machine.posture0
    )
    return tip_in(machine, posture)


def true_tip(world: World) -> FloatArray:
    return world.tip_M_mm() if world.tip_frame == "M" else world.tip_P_mm()


@machines
def test_every_gauge_reads_zero_at_machine_zero(geometry: Geometry, wires: Wiring) -> None:
    world = World(geometry, wires, seed=1, zero_hold_s=5.0)
    run(world, 4.0)
    lengths = [name for name in world.names if name.startswith(("scale_", "joint_", "frame_"))]
    assert len(lengths) == geometry.links + len(wires.joint) + 9
    assert all(abs(world.sense(name)) < 2e-4 for name in lengths)
    assert world.mode == "zero"
    assert world.weather_time_s == 0.0
    assert world.sense("temperature_room_degC") == pytest.approx(20.0, abs=0.1)
    assert geometry.tool.on == "platform"
    assert world.tip_M_mm() == pytest.approx(geometry.tool.zero_tip_M_mm, abs=1e-9)


@machines
def test_ideal_machine_is_where_the_drawing_says(geometry: Geometry, wires: Wiring) -> None:
    world = World(geometry, wires, seed=1, speedup=100.0, strengths=NOTHING)
    run(world, 30.0)
    assert np.abs(scale_mm(world)).max() > 1.0
    assert world.tip_M_mm() == pytest.approx(nominal_tip(world, geometry), abs=1e-9)
    assert all(world.sense(f"frame_{name}") == 0.0 for name in DISTANCES)


@pytest.mark.parametrize(("geometry", "wires"), sampled(MACHINES + OTHERS, 3), ids=IDS)
def test_gauges_explain_joints_and_frame_by_the_papers_equations(geometry: Geometry, wires: Wiring) -> None:
    world = World(geometry, wires, seed=2, speedup=300.0, strengths=FULLY_MEASURED_WITHOUT_NOISE)
    for _ in range(8):
        run(world, 5.0)
        assert compensated_tip(world, geometry, wires) == pytest.approx(true_tip(world), abs=1e-6)
    assert np.linalg.norm(nominal_tip(world, geometry) - true_tip(world)) > 1e-3


@machines
def test_compensation_leaves_a_little_of_a_real_machine(geometry: Geometry, wires: Wiring) -> None:
    world = World(geometry, wires, seed=3, speedup=300.0)
    without_um, with_um = [], []
    for _ in range(12):
        run(world, 3.0)
        without_um.append(1e3 * np.linalg.norm(nominal_tip(world, geometry) - true_tip(world)))
        with_um.append(1e3 * np.linalg.norm(compensated_tip(world, geometry, wires) - true_tip(world)))
    assert max(without_um) > 8.0
    assert max(without_um) < 200.0
    assert 0.05 < np.median(with_um) < 3.0
    assert np.median(with_um) < np.median(without_um) / 4


@machines
def test_asking_where_the_tip_would_be_disturbs_nothing(geometry: Geometry, wires: Wiring) -> None:
    asked, left = (World(geometry, wires, seed=4, speedup=60.0) for _ in range(2))
    for _ in range(40):
        asked.advance(0.25)
        left.advance(0.25)
        here = asked.tip_for(asked.scale_mm.tolist())
        np.testing.assert_allclose(here, asked.tip_M_mm(), atol=1e-9)
        there = asked.tip_for((asked.scale_mm + 0.01).tolist())
        assert 0.001 < np.linalg.norm(there - here) < 1.0
    np.testing.assert_array_equal(asked.tip_M_mm(), left.tip_M_mm())
    assert {name: asked.sense(name) for name in asked.names} == {name: left.sense(name) for name in left.names}


@pytest.mark.long
def test_the_same_seed_gives_the_same_machine_and_another_does_not() -> None:
    first, second, other = (World(tripod(), wiring(), seed=seed, speedup=60.0) for seed in (7, 7, 8))
    for world in (first, second, other):
        run(world, 20.0)
    assert {n: first.sense(n) for n in first.names} == {n: second.sense(n) for n in second.names}
    assert first.sense("joint_1") != other.sense("joint_1")


def test_commanded_machine_drives_there_and_no_further() -> None:
    world = World(tripod(), wiring(), seed=1, zero_hold_s=100.0)
    world.advance(0.1)
    world.command([10.0, -4.0, 2.5])
    world.advance(0.02)
    assert world.mode == "commanded"
    assert world.phase == "moving"
    run(world, 2.0)
    assert world.phase == "dwelling"
    np.testing.assert_array_equal(world.scale_mm, [10.0, -4.0, 2.5])
    assert world.weather_time_s > 0  # a command switches the machine on
    world.start_tour()
    run(world, 10.0)
    assert world.point is not None


def test_an_order_on_the_way_makes_no_jump() -> None:
    """Whatever is ordered while the machine drives, its links go on from where they are, as fast as they are."""
    world = World(tripod(), wiring(), seed=3, strengths=FULLY_MEASURED_WITHOUT_NOISE)
    step_s, path_mm = 0.01, []
    world.start_tour()
    for number in range(3000):
        if number % 330 == 0:
            world.command([20.0 - number / 100, -10.0, 5.0])
        elif number % 37 == 0 and number % 3 == 0:
            world.start_tour()
        world.move(step_s)
        path_mm.append([world.sense_scale(f"scale_{link}") for link in (1, 2, 3)])
        if number % 7 == 0:
            world.advance(0.0)  # what bends lags behind, as it does beside a busy processor
    accelerations = np.diff(np.array(path_mm), 2, axis=0) / step_s**2
    assert np.abs(accelerations).max() <= 1.2 * ACCELERATION_MM_PER_S2
    assert np.abs(np.diff(np.array(path_mm), axis=0)).max() > 0.9 * SPEED_MM_PER_S * step_s


@pytest.mark.parametrize("scales", [[1.0, 2.0], [500.0, 0.0, 0.0], [float("nan"), 0.0, 0.0]])
def test_a_command_that_cannot_be_is_refused(scales: list[float]) -> None:
    world = World(tripod(), wiring(), seed=1)
    for ask in (world.command, world.tip_for):
        with pytest.raises(CompdError, match="scale_mm"):
            ask(scales)
    assert world.mode == "zero"


def test_whole_stroke_can_be_reached() -> None:
    world = World(tripod(), wiring(), seed=1)
    rng = np.random.default_rng(6)
    for _ in range(50):
        scales = rng.uniform(-100.0, 100.0, 3)
        tip_M = world.tip_for(scales.tolist())
        assert np.all(np.isfinite(tip_M))
        assert tip_M[2] < 500.0  # below the base, not its mirror image above


@machines
def test_a_load_does_work_on_the_machine(geometry: Geometry, wires: Wiring) -> None:
    world = World(geometry, wires, seed=1, zero_hold_s=100.0)
    zero_M = world.tip_M_mm()
    for force_M in (np.array([30.0, 0, 0]), np.array([0, -30.0, 0]), np.array([0, 0, 40.0])):
        world.force_M_N = force_M
        world.command([0.0] * geometry.links)
        world.advance(0.01)
        given_mm = float((world.tip_M_mm() - zero_M) @ force_M / np.linalg.norm(force_M))
        assert 1e-4 < given_mm < 2e-2
        assert [world.sense(f"force_{axis}_N") for axis in "xyz"] == force_M.tolist()


def test_tool_on_the_plate_tells_the_place_on_the_work() -> None:
    """Figure 15: the work that hangs from the tripod moves the other way under the fixed tool."""
    geometry = tripod_with_tool_on_plate()
    world = World(geometry, wiring(), seed=1, strengths=NOTHING)
    assert geometry.tool.on == "plate"
    assert world.tip_frame == "P"
    assert world.tip_P_mm() == pytest.approx(geometry.tool.zero_tip_P_mm, abs=1e-9)
    world.command([5.0, 5.0, 5.0])
    run(world, 3.0)
    assert world.tip_M_mm() == pytest.approx(geometry.tool.at_M_mm, abs=1e-9)
    assert world.tip_P_mm()[2] > geometry.tool.zero_tip_P_mm[2] + 4.0  # longer links: the work is lower
    machine = Mechanism(geometry)
    posture = machine.closure.by_lengths(
        machine.joints0_M, machine.joints_P, machine.lengths0_mm + 5.0, machine.posture0
    )
    assert homogeneous(world.tip_P_mm()) @ posture == pytest.approx(geometry.tool.at_M_mm, abs=1e-9)
    np.testing.assert_allclose(world.tip_for([5.0, 5.0, 5.0]), world.tip_P_mm(), atol=1e-9)


def test_drives_stop_before_the_links_part() -> None:
    """Both ends can be reached, the way that the drives take between them cannot."""
    world = World(hexapod(), wiring(HEXAPOD), seed=1)
    world.command([-65.0, 65.0, 36.0, 88.0, 26.0, -55.0])
    run(world, 8.0)
    assert world.mode == "blocked"
    assert world.phase == "dwelling"
    stopped_mm = world.scale_mm
    run(world, 1.0)
    np.testing.assert_array_equal(world.scale_mm, stopped_mm)
    world.command([0.0] * 6)
    run(world, 8.0)
    np.testing.assert_array_equal(world.scale_mm, np.zeros(6))


def test_what_does_not_exist_cannot_be_sensed() -> None:
    with pytest.raises(CompdError, match="temperature_sun_degC"):
        World(tripod(), wiring(), seed=1).sense("temperature_sun_degC")


def test_the_truth_loads_nothing_of_the_model() -> None:
    code = (
        "import sys, compd.simulation.truth.world\n"
        "model = ('compd.model', 'compd.compensation.compensation', 'compd.machine_builder')\n"
        "found = [m for m in sys.modules if m.startswith(model)]\n"
        "sys.exit(', '.join(found) or 0)"
    )
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr
