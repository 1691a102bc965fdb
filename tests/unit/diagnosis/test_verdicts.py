"""Which verdict a recording gets: of a stage whose error is known, noise known or not, with gross rows or without."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from compd.arrays import FloatArray
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.recording_diagnosis import diagnose
from compd.diagnosis.search_criteria import SearchCriteria
from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.summary_lines import summary_lines
from compd.model.effects import Effect
from compd.text import number_text
from tests.support.external_recordings import SIGMA_UM, along, record_external
from tests.support.sampled import sampled

ROWS = 240
PLAY = along("x", "play", "k * moved_1")
GAIN = along("x", "gain", "k * position_mm / 100")
BEND = along("x", "bend", "k * force_x_N / 10")
BED = along("x", "bed", "k * (temperature_bed_degC - 20) / 10")
LATENCY = along("x", "latency", "k * velocity_1_mm_per_s / 10", separated_by="another speed")
BOW = along("x", "bow", "k * (position_mm / 100) * (1 - position_mm / 100)")
EFFECTS = [PLAY, GAIN, BEND, BED, LATENCY, BOW]


def stage_columns(seed: int = 0) -> dict[str, FloatArray]:
    """What was measured beside the stage, at one speed."""
    rng = np.random.default_rng(seed)
    moved = rng.choice([-1.0, 1.0], ROWS)
    return {
        "position_mm": rng.uniform(0, 100, ROWS),
        "moved_1": moved,
        "force_x_N": rng.uniform(-10, 10, ROWS),
        "temperature_bed_degC": 20 + np.cumsum(rng.normal(0, 0.5, ROWS)),
    }


COLUMNS = stage_columns()
MOVED, POSITION = COLUMNS["moved_1"], COLUMNS["position_mm"]
# what no column tells: neither smooth in time nor in place
UNRELATED_UM = np.sin(np.arange(ROWS) / 7) * np.sin(7 * POSITION)


def verdict(
    path: Path,
    error_um: FloatArray,
    columns: dict[str, FloatArray] = COLUMNS,
    effects: Sequence[Effect] = EFFECTS,
    criteria: Criteria = Criteria(),
    **options: Any,
) -> Diagnosis:
    """The diagnosis of a recording of the stage with this error."""
    model_mm = {"x": columns["position_mm"]}
    aligned = record_external(path / "run.csv", columns, {"x": error_um}, model_mm=model_mm, **options)
    return diagnose(aligned, (), None, effects, criteria=criteria)


def ids(diagnosis: Diagnosis) -> list[str]:
    return [step.effect.id for step in diagnosis.steps]


def repeated(rows: int, columns: dict[str, FloatArray] = COLUMNS) -> dict[str, FloatArray]:
    """The columns with every visit measured several times."""
    visit = np.arange(ROWS) // rows
    return {**{name: values[visit * rows] for name, values in columns.items()}, "visit": 1.0 + visit}


# What is missing is found, as much as there is of it.


def test_causes_of_like_size_are_all_named(tmp_path: Path) -> None:
    """None takes 60 % of the error; each is far beyond chance."""
    forces, bed = COLUMNS["force_x_N"], COLUMNS["temperature_bed_degC"] - 20
    error_um = 2 * MOVED + 7 * POSITION / 100 + 3.5 * forces / 10 + 2 * bed / bed.std()
    diagnosis = verdict(tmp_path, error_um)
    assert set(ids(diagnosis)) == {"play", "gain", "bend", "bed"}
    assert diagnosis.verdict == "identified"
    assert all(step.p_value <= 0.01 for step in diagnosis.steps)
    assert max(step.explained_fraction for step in diagnosis.steps[:1]) < 0.6


def test_what_explains_a_part_is_named_with_what_remains(tmp_path: Path) -> None:
    diagnosis = verdict(tmp_path, 3 * MOVED + 4 * UNRELATED_UM)
    assert (diagnosis.verdict, ids(diagnosis)) == ("partial", ["play"])
    assert diagnosis.heldout_before_um > diagnosis.heldout_after_um > 3 * SIGMA_UM
    assert diagnosis.steps[0].parameters[0].value == pytest.approx(3.0, abs=0.3)


def test_what_no_effect_explains_is_unexplained_and_every_effect_was_tried(tmp_path: Path) -> None:
    """It was called not testable where all had been tested."""
    diagnosis = verdict(tmp_path, 10 * UNRELATED_UM)
    assert (diagnosis.verdict, diagnosis.steps, diagnosis.depends_on) == ("unexplained", (), ())
    tried = [candidate.effect for candidate in diagnosis.candidates if candidate.status == "no_gain"]
    assert set(tried) == {"play", "gain", "bend", "bed", "bow"}


def test_without_anything_that_varies_no_effect_can_be_tested(tmp_path: Path) -> None:
    diagnosis = verdict(tmp_path, 10 * UNRELATED_UM, {"position_mm": POSITION}, [PLAY, BEND])
    assert diagnosis.verdict == "not_testable"


@pytest.mark.parametrize("seed", sampled([0, 1, 2, 10, 11], 3))
def test_what_explains_nothing_of_a_random_walk_is_not_named(tmp_path: Path, seed: int) -> None:
    walk_um = np.cumsum(np.random.default_rng(seed).normal(0, 1, ROWS))
    for step in verdict(tmp_path, walk_um, stage_columns(seed)).steps:
        assert step.explained_fraction > 0.1
        assert step.p_value <= 0.05


@pytest.mark.parametrize("seed", range(4))
def test_noise_that_is_larger_than_declared_has_no_cause(tmp_path: Path, seed: int) -> None:
    noise_um = np.random.default_rng(seed).normal(0, 5 * SIGMA_UM, ROWS)
    diagnosis = verdict(tmp_path, noise_um, stage_columns(seed))
    assert (diagnosis.verdict, diagnosis.steps, diagnosis.depends_on) == ("unexplained", (), ())


@pytest.mark.parametrize("factor", [0.1, 0.3])
def test_beside_a_declaration_that_is_too_small_what_is_left_may_be_noise(tmp_path: Path, factor: float) -> None:
    diagnosis = verdict(tmp_path, 3 * MOVED, declared_um=factor * SIGMA_UM)
    assert (diagnosis.verdict, ids(diagnosis), diagnosis.depends_on) == ("partial", ["play"], ())
    floor = diagnosis.before.floor
    assert (floor.source, floor.um) == ("estimate", pytest.approx(SIGMA_UM, rel=0.25))
    assert "how much of it is noise cannot be known" in diagnosis.summary
    for text in (diagnosis.summary, " ".join(" ".join(summary_lines(diagnosis)).split())):
        assert f"({number_text(factor * SIGMA_UM)} um is declared, neighbouring rows scatter by" in text


def test_twins_at_one_speed_are_rivals_at_the_floor_and_above_it(tmp_path: Path) -> None:
    columns = {**COLUMNS, "velocity_1_mm_per_s": 10 * MOVED}
    for remaining_um, word in ((0.0, "ambiguous"), (3.0, "partial")):
        diagnosis = verdict(tmp_path, 3 * MOVED + remaining_um * UNRELATED_UM, columns)
        (step,) = diagnosis.steps
        assert diagnosis.verdict == word
        assert {step.effect.id, *(rival.name for rival in step.rivals)} == {"play", "latency"}
        assert step.rivals[0].cosine == pytest.approx(1.0)


def test_twins_at_two_speeds_are_told_apart(tmp_path: Path) -> None:
    speed = np.random.default_rng(3).choice([5.0, 40.0], ROWS)
    diagnosis = verdict(tmp_path, 3 * MOVED, {**COLUMNS, "velocity_1_mm_per_s": speed * MOVED})
    assert (diagnosis.verdict, ids(diagnosis)) == ("identified", ["play"])


# Noise: what is known of it, and what is not.


def test_without_knowing_the_noise_nothing_is_ever_adequate_or_identified(tmp_path: Path) -> None:
    nothing = verdict(tmp_path, np.zeros(ROWS), declared_um=None)
    assert (nothing.verdict, nothing.steps) == ("not_testable", ())
    assert nothing.before.floor.source == "estimate"
    assert "visit" in str(nothing.next_measurement[0]["measure"])
    play = verdict(tmp_path, 3 * MOVED, declared_um=None)
    assert (play.verdict, ids(play)) == ("partial", ["play"])
    assert play.heldout_after_um == pytest.approx(SIGMA_UM, rel=0.15)


def test_repeats_make_the_noise_known(tmp_path: Path) -> None:
    columns = repeated(2)
    diagnosis = verdict(tmp_path, 3 * columns["moved_1"], columns, declared_um=None)
    assert (diagnosis.verdict, ids(diagnosis)) == ("identified", ["play"])
    assert verdict(tmp_path, np.zeros(ROWS), columns, declared_um=None).verdict == "adequate"


def test_repeats_that_contradict_the_declaration_are_a_fault_to_report(tmp_path: Path) -> None:
    columns = repeated(2)
    diagnosis = verdict(tmp_path, 3 * columns["moved_1"], columns, declared_um=SIGMA_UM / 100)
    assert diagnosis.verdict == "identified"
    assert diagnosis.before.floor.um == pytest.approx(SIGMA_UM, rel=0.15)
    assert "times as much as declared" in diagnosis.before.floor.contradiction


def test_one_gross_row_in_a_visit_of_three_does_not_hide_what_is_missing(tmp_path: Path) -> None:
    """It made noise of 500 um of 0.5, where nothing is missing."""
    columns = repeated(3)
    error_um = 3 * columns["moved_1"]
    error_um[[1, 40, 100]] += 500.0
    diagnosis = verdict(tmp_path, error_um, columns, declared_um=None)
    assert (diagnosis.verdict, ids(diagnosis)) == ("identified", ["play"])
    assert diagnosis.before.floor.um == pytest.approx(SIGMA_UM, rel=0.15)
    assert diagnosis.gross.rows == (3, 42, 102)


# Rows that are gross.


@pytest.mark.parametrize("seed", range(4))
def test_glints_and_a_run_of_bad_rows_change_neither_effects_nor_verdict(tmp_path: Path, seed: int) -> None:
    """4 % of rows off by a Student t with 2 degrees of freedom, and a run of 18."""
    rng = np.random.default_rng(seed)
    error_um = 3 * MOVED + 2 * POSITION / 100
    glints = rng.choice(ROWS, 10, replace=False)
    error_um[glints] += 20 * rng.standard_t(2, 10)
    error_um[100:118] += rng.normal(35, 10, 18)
    diagnosis = verdict(tmp_path, error_um)
    assert (diagnosis.verdict, set(ids(diagnosis))) == ("identified", {"play", "gain"})
    assert len(diagnosis.gross.runs) == 1
    first, last = diagnosis.gross.runs[0]
    assert first <= 102  # row 1 is the header
    assert last >= 119
    assert diagnosis.steps[0].parameters[0].value == pytest.approx(3.0, abs=0.2)


def test_rows_moved_by_a_hundred_times_the_noise_make_nothing_adequate(tmp_path: Path) -> None:
    columns = {**COLUMNS, "velocity_1_mm_per_s": 10 * MOVED}
    error_um = 3 * MOVED
    moved = np.random.default_rng(5).choice(ROWS, 12, replace=False)
    error_um[moved] += 50.0 * np.where(np.arange(12) % 2 == 0, 1.0, -1.0)
    diagnosis = verdict(tmp_path, error_um, columns)
    assert diagnosis.verdict == "ambiguous"
    assert set(diagnosis.gross.rows) == set((moved + 2).tolist())


# Short recordings, gaps, frames and long recordings.


def test_one_empty_cell_leaves_a_quantity_in_the_search(tmp_path: Path) -> None:
    humidity = 50 + np.cumsum(np.random.default_rng(4).normal(0, 1, ROWS))
    error_um = 0.5 * (humidity - 50)
    whole = verdict(tmp_path, error_um, {**COLUMNS, "humidity_pct": humidity})
    gap = humidity.copy()
    gap[77] = np.nan
    empty = verdict(tmp_path, error_um, {**COLUMNS, "humidity_pct": gap})
    assert whole.verdict == empty.verdict == "unexplained"
    for diagnosis in (whole, empty):
        assert diagnosis.depends_on[0].covariate == "humidity_pct"
        assert diagnosis.depends_on[0].form == "linear"
    assert empty.depends_on[0].heldout_rms_um == pytest.approx(whole.depends_on[0].heldout_rms_um, rel=0.05)


@pytest.mark.parametrize("rows", [17, 18])
def test_few_evenly_spaced_rows_are_diagnosed(tmp_path: Path, rows: int) -> None:
    """A period of which the only value is the recording's length had an empty plausible range."""
    position = np.linspace(0, 480, rows)
    diagnosis = verdict(tmp_path, 3 * np.sin(position / 30), {"position_mm": position})
    assert diagnosis.verdict in ("partial", "unexplained")


def test_an_instruments_frame_with_two_axes_is_turned_along(tmp_path: Path) -> None:
    """A plate that lies turned by 2 mrad on the instrument has no error."""
    rng = np.random.default_rng(6)
    x, y = rng.uniform(-100, 100, ROWS), rng.uniform(-100, 100, ROWS)
    turned = {"x": -2 * y, "y": 2 * x}
    aligned = record_external(tmp_path / "plate.csv", {}, turned, model_mm={"x": x, "y": y}, frame="instrument")
    shear = along("x", "shear", "k * tip_y_mm / 100")
    diagnosis = diagnose(aligned, (), None, [shear])
    assert (diagnosis.verdict, diagnosis.steps) == ("adequate", ())
    assert diagnosis.before.rms_um == pytest.approx(SIGMA_UM, rel=0.1)


def test_a_long_recording_is_thinned_and_gets_the_same_verdict(tmp_path: Path) -> None:
    diagnosis = verdict(tmp_path, 3 * MOVED, criteria=Criteria(search=SearchCriteria(max_rows=120)))
    assert (diagnosis.verdict, ids(diagnosis)) == ("identified", ["play"])
    assert len(diagnosis.before.used) == 120
