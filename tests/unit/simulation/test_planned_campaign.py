"""A plan's file, read for a machine; how the machine goes about its rows; and the recording that comes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from compd.configuration import load
from compd.errors import CompdError
from compd.simulation.campaign.plan_reader import holdable_quantities, read_plan
from compd.simulation.campaign.simulated_recording import SimulatedRecording, simulate_recording
from compd.simulation.causes.hidden_cause import HiddenCause
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.motion import SPEED_MM_PER_S, standing
from compd.simulation.truth.plan_motion import DWELL_S, SETTLED_S, PlanMotion, Stage, plan_stages
from compd.simulation.truth.planned_row import TURN_MM, PlannedRow
from compd.simulation.truth.strengths import FULLY_MEASURED_WITHOUT_NOISE
from compd.simulation.truth.world import World
from tests.support.planned_measurements import plan_file
from tests.support.simulated import HEXAPOD, TRIPOD, hexapod, tripod, tripod_with_tool_on_plate, wiring

TRIPOD_MACHINE = Mechanism(tripod())
WARM = ("temperature_link_1_degC", "temperature_link_2_degC", "temperature_link_3_degC")
OTHER_WEATHER = ("temperature_room_degC", "pressure_hPa", "humidity_pct")


def read(path: Path) -> tuple[PlannedRow, ...]:
    return read_plan(path, TRIPOD_MACHINE)


def problems(path: Path) -> str:
    with pytest.raises(CompdError) as caught:
        read(path)
    return str(caught.value)


def staged(rows: tuple[PlannedRow, ...], speedup: float = 1.0) -> list[Stage]:
    return list(plan_stages(rows, np.zeros(3), lambda _: None, speedup))


# --- the file ---------------------------------------------------------------------------------------------


def test_rows_as_they_are_planned(tmp_path: Path) -> None:
    up = {f"approach_{i}": 1 for i in (1, 2, 3)}
    rows = read(
        plan_file(
            tmp_path / "next.csv",
            [
                {"time_s": 0.0, "purpose": "a load, along x"},
                {"time_s": 30.0, "tip_x_mm": 40.0, "force_x_N": 12.5, **up},
                {"time_s": 0.0, "speed_mm_per_s": 5.0, **up},
            ],
            ["force_x_N"],
        )
    )
    assert [row.number for row in rows] == [1, 2, 3]
    assert [row.begins for row in rows] == [True, False, True]
    assert [row.point for row in rows] == [1, 2, 1]
    assert [row.on_the_move for row in rows] == [False, False, True]
    assert rows[0].purpose == "a load, along x"
    assert rows[0].scale_mm == pytest.approx(np.zeros(3), abs=1e-9)
    assert rows[1].quantities == {"force_x_N": 12.5}
    posture = TRIPOD_MACHINE.posture_at(np.array([40.0, 0.0, 190.0]), np.zeros(3))
    assert rows[1].scale_mm == pytest.approx(TRIPOD_MACHINE.lengths(posture) - TRIPOD_MACHINE.lengths0_mm)


def test_a_person_may_leave_columns_out(tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    path.write_text("\ufefftime_s,tip_x_mm,tip_y_mm,tip_z_mm\r\n0,0,0,190\r\n\r\n30, 5 ,0,190\r\n", encoding="utf-8")
    first, second = read(path)
    assert (first.purpose, second.begins, second.speed_mm_per_s) == ("", False, 0.0)
    assert second.approach.tolist() == [0.0, 0.0, 0.0]


def test_everything_that_is_wrong_is_said_at_once(tmp_path: Path) -> None:
    wrong = plan_file(
        tmp_path / "wrong.csv",
        [
            {"tip_x_mm": "4O"},
            {"tip_x_mm": 900.0},
            {"speed_mm_per_s": 80.0, "approach_1": 1},
            {"speed_mm_per_s": 5.0},
            {"approach_2": 0.5},
            {"temperature_link_1_degC": 400.0},
            {"time_s": ""},
            {"tip_z_mm": 70.0, "approach_1": 1, "approach_2": 1, "approach_3": 1},
        ],
        ["temperature_link_1_degC", "temperature_link_4_degC", "force_w_N", "spindle_rpm"],
    )
    text = problems(wrong)
    for line, what in (
        ("1 column temperature_link_4_degC", "is no setting of this machine"),
        ("1 column force_w_N", "did you mean force_"),
        ("1 column spindle_rpm", "delete the column"),
        ("3 column tip_x_mm, tip_y_mm, tip_z_mm", "cannot reach the place"),
        ("4 column speed_mm_per_s", "is faster than this machine's drives"),
        ("5 column approach_1 ...", "a row on the move needs a direction"),
        ("6 column approach_2", "is out of range"),
        ("7 column temperature_link_1_degC", "is out of range"),
        ("8 column time_s", "is empty"),
    ):
        start = text.index(f"{wrong}:{line}: ")
        assert what in text[start : start + 1200].split(f"\n{wrong}")[0], line
    assert "column tip_x_mm (D), row 2: a unit behind the number" in text
    assert f"0 to {SPEED_MM_PER_S:g}" in text


def test_no_room_to_come_from_a_side(tmp_path: Path) -> None:
    high = TRIPOD_MACHINE.posture_at(np.array([0.0, 0.0, 190.0]), np.zeros(3))
    stroke_mm = 0.3 * TRIPOD_MACHINE.lengths0_mm
    posture = TRIPOD_MACHINE.closure.by_lengths(
        TRIPOD_MACHINE.joints0_M, TRIPOD_MACHINE.joints_P, TRIPOD_MACHINE.lengths0_mm - stroke_mm + TURN_MM / 2, high
    )
    z_mm = float((np.array([1.0, *TRIPOD_MACHINE.tip0_P]) @ posture)[2])
    place = {"tip_z_mm": round(z_mm, 3)}
    longer, shorter = ({**place, **{f"approach_{i}": sign for i in (1, 2, 3)}} for sign in (1, -1))
    assert len(read(plan_file(tmp_path / "next.csv", [shorter]))) == 1
    assert "no room to come from this side" in problems(plan_file(tmp_path / "next.csv", [longer]))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "is empty"),
        ("time_s,tip_x_mm,tip_y_mm,tip_z_mm\n", "has no row"),
        ("time_s,tip_x_mm,tip_y_mm\n0,0,0\n", "column tip_z_mm: is missing"),
        ("time_s,time_s,tip_x_mm,tip_y_mm,tip_z_mm\n0,0,0,0,190\n", "two columns of the same name"),
        ("time_s,tip_x_mm,tip_y_mm,tip_z_mm\n0,0,190\n", "row 2: fewer cells than the header"),
    ],
)
def test_a_file_that_is_no_plan(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "next.csv"
    path.write_text(text, encoding="utf-8")
    assert problem in problems(path)


def test_a_plan_that_does_not_suit_the_machine(tmp_path: Path) -> None:
    path = plan_file(tmp_path / "next.csv", [{}], ["force_x_N", "pressure_hPa"])
    with pytest.raises(CompdError, match=r"column force_x_N: no gauge of this machine measures it"):
        read_plan(path, TRIPOD_MACHINE, ["pressure_hPa"])
    with pytest.raises(CompdError, match="stands on the plate"):
        read_plan(path, Mechanism(tripod_with_tool_on_plate()))
    with pytest.raises(CompdError, match="cannot be read"):
        read(tmp_path / "nowhere.csv")


@pytest.mark.parametrize(("geometry", "wires"), [(tripod(), wiring()), (hexapod(), wiring(HEXAPOD))])
def test_what_can_be_held_can_be_sensed(geometry: object, wires: object) -> None:
    world = World(geometry, wires, 1)  # type: ignore[arg-type]
    holdable = holdable_quantities(world.mechanism.links)
    shown = [name for name in world.names if not name.startswith(("scale_", "joint_", "frame_"))]
    assert sorted(holdable) == sorted(shown)


# --- how the machine goes about it ----------------------------------------------------------------------------


def test_every_row_is_reached_from_its_side(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    planned = [
        {
            **{f"tip_{a}_mm": round(float(v), 3) for a, v in zip("xyz", tip, strict=True)},
            **{f"approach_{i}": int(rng.choice([-1, 1])) for i in (1, 2, 3)},
        }
        for tip in rng.uniform([-60, -60, 150], [60, 60, 220], (12, 3))
    ]
    rows = read(plan_file(tmp_path / "next.csv", planned))
    last = np.zeros(3)
    for stage in staged(rows):
        moved = stage.move.end_mm - stage.move.start_mm
        last = np.where(moved != 0, np.sign(moved), last)
        if stage.purpose == "look":
            assert last.tolist() == stage.row.approach.tolist()
            assert stage.move.end_mm == pytest.approx(stage.row.scale_mm)
            assert stage.duration_s == DWELL_S


def test_reversals_are_gone_straight_to(tmp_path: Path) -> None:
    """An excursion would undo what a reversal has built up."""
    heights_mm = [190.0, 190.02, 189.98, 190.5, 189.5]
    rows = read(
        plan_file(
            tmp_path / "next.csv",
            [
                {"tip_z_mm": z, "time_s": 30.0 * k, **{f"approach_{i}": sign for i in (1, 2, 3)}}
                for k, (z, sign) in enumerate(zip(heights_mm, (1, -1, 1, -1, 1), strict=True))
            ],
        )
    )
    ways = [stage.row.number for stage in staged(rows) if stage.purpose == "way"]
    assert ways == [2, 3, 4, 5]  # it stands at the first one's place, and came from there


def test_waiting_and_settling(tmp_path: Path) -> None:
    warm = dict.fromkeys(WARM, 24.0)
    rows = read(
        plan_file(tmp_path / "next.csv", [{**warm}, {**warm, "time_s": 600.0}, {**dict.fromkeys(WARM, 20.0)}], WARM)
    )
    timeline = [(stage.row.number, stage.purpose, stage.duration_s) for stage in staged(rows, speedup=10.0)]
    assert [(number, purpose) for number, purpose, _ in timeline] == [
        (1, "settle"),
        (1, "look"),
        (2, "wait"),
        (2, "look"),
        (3, "settle"),
        (3, "look"),
    ]
    assert timeline[0][2] == pytest.approx(SETTLED_S / 10)
    assert timeline[1][2] + timeline[2][2] == pytest.approx(60.0)  # from the first row, of which some was spent looking


def test_a_row_on_the_move_is_passed_at_its_speed(tmp_path: Path) -> None:
    row = {"speed_mm_per_s": 20.0, "approach_1": 1, "approach_2": 1, "approach_3": 1}
    rows = read(plan_file(tmp_path / "next.csv", [row]))
    look = staged(rows)[-1]
    middle_s = look.move.duration_s / 2
    near = [look.move.position_mm(middle_s + dt) for dt in (-0.2, 0.0, 0.2)]
    assert near[1] == pytest.approx(rows[0].scale_mm, abs=1e-9)
    assert np.diff(near, axis=0) / 0.2 == pytest.approx(np.full((2, 3), 20.0))


def test_the_drives_follow_the_stages_in_any_steps(tmp_path: Path) -> None:
    rows = read(plan_file(tmp_path / "next.csv", [{"tip_x_mm": 20.0}, {"tip_x_mm": -20.0, "time_s": 30.0}]))
    held: list[object] = []
    motions = [PlanMotion(rows, standing(np.zeros(3)), held.append, 1.0, [np.full(3, 5.0)]) for _ in range(2)]
    whole_s = sum(stage.duration_s for stage in plan_stages(rows, np.zeros(3), held.append, 1.0, [np.full(3, 5.0)]))
    assert motions[0].progress() == {"row": 1, "rows": 2, "purpose": "a test", "doing": "walk", "done": False}
    moved_s = [
        motions[0].advance(whole_s + 0.001),
        sum(motions[1].advance(0.02) for _ in range(int(whole_s / 0.02) + 1)),
    ]
    assert moved_s[0] == pytest.approx(moved_s[1])
    for motion in motions:
        assert motion.position_mm == pytest.approx(rows[1].scale_mm)
        assert (motion.progress()["row"], motion.progress()["doing"], motion.phase) == (2, "done", "dwelling")


def test_what_is_held_is_as_told(tmp_path: Path) -> None:
    world = World(tripod(), wiring(), 1, strengths=FULLY_MEASURED_WITHOUT_NOISE)
    names = holdable_quantities(3)
    quantities = {name: 20.0 + 0.3 * k for k, name in enumerate(names) if name.startswith("temperature_")}
    quantities |= {"pressure_hPa": 990.0, "humidity_pct": 61.0, "force_x_N": 5.0, "force_y_N": -6.0, "force_z_N": 7.0}
    world.hold(quantities)
    world.advance_to(world.scale_mm, world.posture, SETTLED_S, 0.0)
    for name, value in quantities.items():
        assert world.sense(name) == pytest.approx(value, abs=0.12), name
    world.hold({})
    world.advance_to(world.scale_mm, world.posture, 48 * 3600.0, 0.0)
    assert world.sense("pressure_hPa") > 1000.0
    assert world.sense("force_x_N") == 0.0
    assert abs(world.sense("temperature_plate_bottom_degC") - quantities["temperature_plate_bottom_degC"]) > 1.0


# --- the recording that comes of it -----------------------------------------------------------------------------


def campaign(path: Path, other_days: int = 0) -> SimulatedRecording:
    return simulate_recording(
        load(TRIPOD), 4, [HiddenCause("backlash", 3.0)], other_days=other_days, planned_rows=read(path)
    )


@pytest.mark.long
def test_a_recording_of_the_planned_rows_on_the_same_machine(tmp_path: Path) -> None:
    up = {f"approach_{i}": 1 for i in (1, 2, 3)}
    warm = dict.fromkeys(WARM, 25.0)
    path = plan_file(
        tmp_path / "next.csv",
        [
            {"tip_x_mm": 30.0, "force_z_N": -40.0, **dict.fromkeys(WARM, 20.0), **up},
            {"tip_x_mm": 30.0, "force_z_N": 40.0, "time_s": 30.0, **warm, **up},
            {"speed_mm_per_s": 5.0, **warm, **up},
        ],
        ["force_z_N", *WARM],
    )
    recorded = campaign(path)
    columns = {name: np.array(values) for name, values in recorded.columns.items()}
    measured = np.isfinite(columns["reference_x_mm"])
    assert measured.sum() == 5  # twice at rest, once on the move
    assert np.all(np.diff(columns["time_s"]) > 0)
    assert columns["force_z_N"][measured].tolist() == [-40.0, -40.0, 40.0, 40.0, 0.0]
    assert columns["temperature_link_2_degC"][measured] == pytest.approx([20, 20, 25, 25, 25], abs=0.15)
    assert (columns["approach_1"][measured] == 1.0).all()
    assert columns["point"][measured][:4].tolist() == [1.0] * 4
    assert np.diff(columns["visit"])[np.flatnonzero(measured)[[0, 2]]].tolist() == [0.0, 0.0]
    k = int(np.flatnonzero(measured)[-1])
    speed = np.diff(columns["scale_1_mm"])[k - 1 : k + 1] / np.diff(columns["time_s"])[k - 1 : k + 1]
    assert speed == pytest.approx([5.0, 5.0], rel=1e-3)
    # while the links warmed up the gauges were read often enough to see how
    assert (~measured & (columns["temperature_link_1_degC"] > 21) & (columns["temperature_link_1_degC"] < 24.5)).any()
    other = simulate_recording(load(TRIPOD), 4, [HiddenCause("backlash", 3.0)])
    assert {cause.id: cause.values for cause in recorded.weak} == {cause.id: cause.values for cause in other.weak}
    assert recorded.hidden[0].cause.values == other.hidden[0].cause.values


@pytest.mark.long
def test_the_same_seed_measures_the_same_and_another_day_does_not(tmp_path: Path) -> None:
    path = plan_file(tmp_path / "next.csv", [{"tip_x_mm": 10.0}, {"tip_y_mm": 10.0}])
    first, again, other = campaign(path), campaign(path), campaign(path, other_days=1)
    for name, values in first.columns.items():
        np.testing.assert_array_equal(values, again.columns[name])
    assert first.columns["scale_1_mm"] == pytest.approx(other.columns["scale_1_mm"], abs=1e-3)
    assert first.columns["pressure_hPa"] != other.columns["pressure_hPa"]
    assert first.weak[0].values == other.weak[0].values


def test_a_ball_plate_stays_where_it_is(tmp_path: Path) -> None:
    path = plan_file(tmp_path / "next.csv", [{}])
    options = ["--out", str(tmp_path / "next_days.csv"), "--plan", str(path), "--reference", "ball_plate"]
    result = CliRunner().invoke(app, ["sim", "campaign", str(TRIPOD), *options])
    assert isinstance(result.exception, CompdError)
    assert "ball plate's balls" in str(result.exception)
