"""Simulated campaigns: recordings in the format, with what was asked for in them and nothing else."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from compd.cli.app import app
from compd.configuration import load
from compd.errors import CompdError
from compd.recording import Recording, read_recording
from compd.simulation import simulate_campaign
from compd.simulation.campaign.campaign import Campaign, steady_speed_mm_per_s
from compd.simulation.campaign.campaign_plan import GAP_S, SESSIONS, draw_campaign_plan
from compd.simulation.campaign.row_log import LoggedRows
from compd.simulation.campaign.simulated_recording import CauseSizer, SimulatedRecording, simulate_recording
from compd.simulation.causes.catalogue import CAUSES, build_cause, possible_causes
from compd.simulation.causes.hidden_cause import MAX_FLOORS, MIN_FLOORS, HiddenCause, draw_hidden, parse_hidden
from compd.simulation.truth.instruments import BALLS, TRACKER, TRACKER_SIGMA_UM, ball_plate_mm
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.motion import ACCELERATION_MM_PER_S2, Move
from compd.simulation.truth.strengths import FULLY_MEASURED, FULLY_MEASURED_WITHOUT_NOISE, NOTHING
from tests.support.paths import SHARED
from tests.support.simulated import HEXAPOD, TRIPOD, hexapod, tripod, wiring

TRACKER_WITH_OUTLIERS = replace(TRACKER, outlier_share=0.01)
EXAMPLE = SHARED / "recordings" / "example-nothing-missing" / "train.csv"


@pytest.fixture(scope="module")
def machine() -> Mechanism:
    return Mechanism(tripod())


@pytest.fixture(scope="module")
def recorded() -> SimulatedRecording:
    return simulate_recording(load(TRIPOD), 3, [HiddenCause("link_expansion", None, 4.0)])


def column(recorded: SimulatedRecording, name: str) -> Any:
    return np.array(recorded.columns[name], dtype=float)


@pytest.mark.long
def test_columns_are_those_of_the_example_recordings(recorded: SimulatedRecording) -> None:
    if not EXAMPLE.exists():
        pytest.skip(f"the example recordings are not at {EXAMPLE.parent.parent}")
    with EXAMPLE.open(encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    assert set(recorded.columns) == set(header)
    assert 0.8 * len(rows) < len(recorded.columns["time_s"]) < 1.3 * len(rows)


@pytest.mark.long
@pytest.mark.sample
def test_sessions_points_repeats_and_loads(recorded: SimulatedRecording) -> None:
    time_s, session, point, visit = (column(recorded, name) for name in ("time_s", "session", "point", "visit"))
    assert np.all(np.diff(time_s) > 0)
    assert np.unique(session).tolist() == list(range(1, SESSIONS + 1))
    assert np.diff(time_s)[np.diff(session) > 0] == pytest.approx(GAP_S, rel=0.02)
    again = np.diff(visit) == 0
    assert 0.1 < again.mean() < 0.3
    assert np.all(point[:-1][again] == point[1:][again])
    for number in np.unique(point[np.isfinite(point)]):
        assert len(np.unique(session[point == number])) > 1  # revisited in other weather
    loaded = np.any([column(recorded, f"force_{axis}_N") != 0 for axis in "xyz"], axis=0)
    assert 0.35 < loaded.mean() < 0.55
    for link in (1, 2, 3):
        forward = (column(recorded, f"approach_{link}") > 0).mean()
        assert 0.3 < forward < 0.7
    for place in ("link_1", "link_2", "link_3", "platform", "tool", "frame", "base"):
        assert np.ptp(column(recorded, f"temperature_{place}_degC")) > 2.0


@pytest.mark.long
def test_immediate_repeats_scatter_as_the_tracker_does(recorded: SimulatedRecording) -> None:
    again = np.diff(column(recorded, "visit")) == 0
    differences = np.concatenate([np.diff(column(recorded, f"reference_{axis}_mm"))[again] for axis in "xyz"])
    sigma_um = 1.4826 * np.median(np.abs(differences)) / np.sqrt(2) * 1e3
    assert sigma_um == pytest.approx(TRACKER_SIGMA_UM, rel=0.15)


@pytest.mark.long
def test_a_pass_moves_at_constant_speed(recorded: SimulatedRecording) -> None:
    time_s, scale_mm = column(recorded, "time_s"), column(recorded, "scale_1_mm")
    quick = np.diff(time_s) < 0.25
    speed = np.abs(np.diff(scale_mm)[quick] / np.diff(time_s)[quick])
    assert quick.sum() > 20
    assert speed.max() < 21.0
    assert np.unique(np.round(speed[speed > 0.5], 0)).size > 3


@pytest.mark.long
def test_one_row_in_a_hundred_is_far_off(machine: Mechanism) -> None:
    days = draw_campaign_plan(machine, 3)
    measured = Campaign(tripod(), wiring(), days, 3, NOTHING, reference=TRACKER_WITH_OUTLIERS).run()
    true = Campaign(tripod(), wiring(), days, 3, NOTHING).run()
    names = [f"reference_{axis}_mm" for axis in "xyz"]
    error_um = 1e3 * np.array([np.array(measured.columns[name]) - np.array(true.columns[name]) for name in names])
    outliers = np.abs(error_um).max(axis=0) > 6 * TRACKER_SIGMA_UM
    assert 0.002 < outliers.mean() < 0.02
    assert np.std(error_um[:, ~outliers]) == pytest.approx(TRACKER_SIGMA_UM, rel=0.1)


@pytest.mark.long
def test_gauges_explain_a_machine_without_hidden_causes(machine: Mechanism) -> None:
    for geometry, wires in ((tripod(), wiring()), (hexapod(), wiring(HEXAPOD))):
        sizer = CauseSizer(geometry, wires, 4)
        rows = Campaign(geometry, wires, sizer.plan.thinned(5), 4, FULLY_MEASURED_WITHOUT_NOISE).run()
        assert rows.error_um() < 1e-3
        unseen = replace(FULLY_MEASURED_WITHOUT_NOISE, platform_expansion_ppm_per_K=10.0)
        assert Campaign(geometry, wires, sizer.plan.thinned(5), 4, unseen).run().error_um() > 0.1


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["link_expansion", "backlash", "joint_contact", "reference_drift", "humidity_swelling"]
)
def test_a_cause_is_as_strong_as_it_takes(name: str) -> None:
    sizer = CauseSizer(tripod(), wiring(), 5)
    sized = sizer.size(HiddenCause(name, None, 3.0))
    assert sized.floors == pytest.approx(3.0, rel=0.06)
    assert CAUSES[name].min_strength <= abs(sized.cause.strength) <= CAUSES[name].max_strength
    same = sizer.size(HiddenCause(name, sized.cause.strength))
    assert same.floors == pytest.approx(sized.floors, rel=1e-9)


@pytest.mark.long
def test_weak_disturbances_are_two_and_weak(recorded: SimulatedRecording) -> None:
    sizer = CauseSizer(tripod(), wiring(), 3)
    assert len(recorded.weak) == 2
    assert "link_expansion" not in [cause.id for cause in recorded.weak]
    for cause in recorded.weak:
        again = build_cause(cause.id, cause.strength, sizer.mechanism, 3)
        assert sizer.error_in_floors(again) == pytest.approx(0.2, rel=0.1)


@pytest.mark.long
def test_a_weak_disturbance_is_not_stronger_than_it_can_be() -> None:
    """The joints' run-out across the links does next to nothing to a hexapod: no strength would be enough."""
    weak = CauseSizer(hexapod(), wiring(HEXAPOD), 6).weak_disturbances(["scale_expansion"])
    assert "joint_runout" in [cause.id for cause in weak]
    assert all(abs(cause.strength) <= CAUSES[cause.id].max_strength for cause in weak)


def test_a_way_too_short_for_the_speed_is_passed_slowly() -> None:
    start_mm, end_mm = np.zeros(3), np.array([1.0, -4.0, 0.5])
    assert steady_speed_mm_per_s(start_mm, end_mm, 20.0) == 20.0
    speed_mm_per_s = steady_speed_mm_per_s(start_mm, end_mm, 50.0)
    move = Move(start_mm, end_mm, speed_mm_per_s)
    steady_s = move.duration_s - 2 * speed_mm_per_s / ACCELERATION_MM_PER_S2
    assert steady_s * speed_mm_per_s == pytest.approx(2.0), "half of the way"


@pytest.mark.long
def test_every_campaign_of_a_machine_has_rows_in_the_order_of_time(machine: Mechanism) -> None:
    """On the third day of machine 15 a pass goes to a place that is near."""
    plan = draw_campaign_plan(machine, 15, 2)
    rows = Campaign(tripod(), wiring(), plan, 15, NOTHING, []).run()
    assert (np.diff(rows.columns["time_s"]) > 0).all()


def test_what_is_hidden_follows_from_its_number(machine: Mechanism) -> None:
    hidden = [draw_hidden(seed, machine) for seed in range(300)]
    assert hidden == [draw_hidden(seed, machine) for seed in range(300)]
    assert {cause.id for cause in hidden} == set(possible_causes(machine))
    assert all(MIN_FLOORS <= cause.floors <= MAX_FLOORS for cause in hidden)
    outside = np.mean([not CAUSES[cause.id].in_library for cause in hidden])
    assert 0.1 < outside < 0.3
    without_axes = Mechanism(hexapod())
    assert "revolute_axis_tilt" not in {draw_hidden(seed, without_axes).id for seed in range(300)}


def test_what_is_asked_for() -> None:
    stiffness, backlash = parse_hidden(["link_elasticity=25", "backlash"])
    assert stiffness == HiddenCause("link_elasticity", 1 / 25)
    assert backlash == HiddenCause("backlash", None)
    with pytest.raises(CompdError) as caught:
        parse_hidden(["witchcraft=1", "backlash=much", "link_elasticity=0"])
    assert len(caught.value.problems) == 3


@pytest.mark.long
def test_the_same_seed_brings_home_the_same(machine: Mechanism) -> None:
    def rows() -> LoggedRows:
        days = draw_campaign_plan(machine, 6).thinned(4)
        causes = [build_cause("backlash", 1.0, machine, 6)]
        return Campaign(tripod(), wiring(), days, 6, FULLY_MEASURED, causes, reference=TRACKER_WITH_OUTLIERS).run()

    first, again = rows(), rows()
    for name, values in first.columns.items():
        np.testing.assert_array_equal(values, again.columns[name])


@pytest.mark.long
def test_other_days_are_on_the_same_machine(recorded: SimulatedRecording) -> None:
    other = simulate_recording(
        load(TRIPOD), 3, [HiddenCause("link_expansion", recorded.hidden[0].cause.strength)], other_days=1
    )
    assert {cause.id: cause.values for cause in recorded.weak} == {cause.id: cause.values for cause in other.weak}
    first_mm, other_mm = (column(days, "reference_x_mm")[:50] for days in (recorded, other))
    assert np.abs(first_mm - other_mm).max() > 1.0


def test_balls_of_a_plate_are_apart_and_within_reach(machine: Mechanism) -> None:
    balls = ball_plate_mm(machine.tip0_M)
    apart = np.linalg.norm(balls[:, None] - balls, axis=2) + 1e3 * np.eye(BALLS)
    assert balls.shape == (BALLS, 3)
    assert apart.min() > 20.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("config", "options", "quantity"),
    [
        (TRIPOD, ["--hidden", "7"], "tool_position"),
        (TRIPOD, ["--effect", "link_expansion=11", "--reference", "interferometer"], "link_length"),
        (TRIPOD, ["--effect", "backlash", "--reference", "ball_plate"], "ball_plate"),
        (HEXAPOD, ["--effect", "humidity_swelling"], "tool_position"),
    ],
)
def test_command_writes_what_the_workbench_reads(
    tmp_path: Path, config: Path, options: list[str], quantity: str
) -> None:
    out = tmp_path / "days.csv"
    result = CliRunner().invoke(app, ["sim", "campaign", str(config), "--out", str(out), "--seed", "2", *options])
    assert result.exit_code == 0, result.output
    recording = read_recording(out, load(config))
    assert recording.reference is not None
    assert recording.reference.quantity == quantity
    assert recording.rows > 400
    answer = json.loads((tmp_path / "days.answer.json").read_text(encoding="utf-8"))
    (name,) = answer["effects"]
    assert answer["kind"] == ("library" if CAUSES[name].in_library else "outside")
    assert answer["answers"] == ([name] if CAUSES[name].in_library else [])
    assert len(answer["weak_disturbances"]) == 2
    if "--hidden" in options:
        assert name not in result.output  # under seal
    if quantity == "link_length":
        assert recording.reference_link_mm is not None
        assert _expansion_ppm_per_K(recording) == pytest.approx(11.0, rel=0.1)


def _expansion_ppm_per_K(recording: Recording) -> float:
    """Of link 1, from what the interferometer shows beyond scale and comparators, equation (1)."""
    columns = recording.columns
    warm_K = columns["temperature_link_1_degC"] - 20.0
    measured_um = columns["joint_1_um"] + (columns["joint_2_um"] + columns["joint_3_um"]) / 2
    grown_um = 1e3 * (columns["reference_link_1_mm"] - columns["scale_1_mm"]) + measured_um
    length_mm = Mechanism(tripod()).lengths0_mm[0] + columns["scale_1_mm"]
    slope, *_ = np.linalg.lstsq((length_mm * warm_K * 1e-3)[:, None], grown_um, rcond=None)
    return float(slope[0])


def test_a_campaign_remembers_the_machine_that_only_a_file_describes(tmp_path: Path) -> None:
    own = tmp_path / "own.yaml"
    own.write_text(TRIPOD.read_text(encoding="utf-8"), encoding="utf-8")
    for machine, name in ((own, "own.yaml"), (TRIPOD, None)):
        out = tmp_path / f"of-{machine.stem}.csv"
        simulate_campaign(machine, out)
        sidecar = yaml.safe_load(out.with_suffix(".yaml").read_text(encoding="utf-8"))
        assert sidecar.get("machine_file") == name
