"""The constant: a competitor without a cause, the effects that make nothing else, and what is said of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import compd
from compd.comparison import AlignedRecording, fit, initial_effect
from compd.diagnosis.candidates.candidates import library_pool
from compd.diagnosis.candidates.constant import constant_candidate, constant_effect, makes_only, split_constants
from compd.diagnosis.recording_diagnosis import diagnose
from compd.diagnosis.verdict import Diagnosis
from compd.units import UM_PER_MM
from tests.support.external_recordings import along, record_external
from tests.support.hidden_effects import LIBRARY, NOISE_UM, record_with_effects

EFFECTS = list(LIBRARY.values())
ROWS = 240
GAIN = along("x", "gain", "k * position_mm / 100")
PLAY = along("x", "play", "k * moved_1")
OFFSET = along("x", "offset", "k")
ZERO = along("x", "zero", "2 * k")


def stage(path: Path, error_um: float, play_um: float = 3.0, seed: int = 1) -> AlignedRecording:
    """A stage with play and a gain of 2 um in 100 mm, and a constant error."""
    rng = np.random.default_rng(seed)
    position, moved = rng.uniform(0, 100, ROWS), rng.choice([-1.0, 1.0], ROWS)
    columns = {"position_mm": position, "moved_1": moved}
    gain_um = 2.0 * position / 100 if play_um else 0.0
    return record_external(path, columns, {"x": play_um * moved + gain_um + error_um}, model_mm={"x": position})


@pytest.fixture(scope="module")
def tripod(tmp_path_factory: pytest.TempPathFactory) -> AlignedRecording:
    return record_with_effects(tmp_path_factory.mktemp("tripod") / "run.csv", 1, {})


def test_on_a_known_machine_the_constant_competes_at_an_effects_price(tripod: AlignedRecording) -> None:
    constant = constant_candidate(tripod)
    assert constant is not None
    np.testing.assert_allclose(constant.columns_um, np.broadcast_to(np.eye(3), (len(tripod.rows), 3, 3)))
    assert (constant.kind, constant.parameter_count) == ("constant", 3)
    assert np.isinf(constant.limits).all()


def test_where_a_constant_or_a_frame_is_fitted_along_it_does_not_compete(tmp_path: Path) -> None:
    assert constant_candidate(stage(tmp_path / "run.csv", 0.0)) is None


def test_the_constant_is_fitted_in_um(tmp_path: Path) -> None:
    shift = np.tile([4.0, -3.0, 2.0], (200, 1))
    aligned = record_with_effects(tmp_path / "run.csv", 1, {}, extra_um=shift)
    (fitted,) = fit(aligned, [initial_effect(constant_effect(aligned), {}, 3)]).fitted
    assert fitted.theta == pytest.approx([4.0, -3.0, 2.0], abs=0.05)


def test_columns_make_only_what_others_span() -> None:
    rng = np.random.default_rng(1)
    others = rng.standard_normal((50, 3, 4))
    inside = others @ rng.standard_normal((4, 2))
    assert makes_only(inside, others)
    assert not makes_only(inside + 0.02 * rng.standard_normal(inside.shape), others)
    assert not makes_only(np.concatenate([inside, rng.standard_normal((50, 3, 1))], axis=2), others)
    assert not makes_only(inside, np.zeros((50, 3, 0)))


def test_effects_that_make_a_constant_alone_do_not_compete_beside_one(tmp_path: Path) -> None:
    aligned = stage(tmp_path / "run.csv", 0.0)
    pool = library_pool(aligned, [GAIN, OFFSET, ZERO], ())
    nuisance_um = aligned.registration_columns * UM_PER_MM
    competing, same = split_constants(pool.candidates, nuisance_um, np.ones(ROWS, dtype=bool))
    assert [candidate.name for candidate in competing] == ["gain"]
    assert [candidate.name for candidate in same] == ["offset", "zero"]


def test_an_effect_that_varies_on_a_row_that_does_not_count_is_a_constant(tmp_path: Path) -> None:
    once = np.zeros(ROWS)
    once[7] = 1.0
    aligned = record_external(tmp_path / "run.csv", {"once_1": once}, {"x": np.zeros(ROWS)})
    pool = library_pool(aligned, [along("x", "mostly", "k * (1 + once_1)")], ())
    nuisance_um = aligned.registration_columns * UM_PER_MM
    assert len(split_constants(pool.candidates, nuisance_um, once == 0.0)[1]) == 1
    assert len(split_constants(pool.candidates, nuisance_um, np.ones(ROWS, dtype=bool))[0]) == 1


def numbers(diagnosis: Diagnosis) -> list[float]:
    return [number.value for step in diagnosis.steps for number in step.parameters]


@pytest.mark.parametrize("shift_um", [-2300.0, 40.0, 1e5])
def test_a_constant_changes_nothing_but_the_line_that_tells_it(tmp_path: Path, shift_um: float) -> None:
    effects = [GAIN, PLAY, OFFSET, ZERO]
    plain = diagnose(stage(tmp_path / "plain.csv", 0.0), (), None, effects)
    shifted = diagnose(stage(tmp_path / "shifted.csv", shift_um), (), None, effects)
    assert plain.verdict == shifted.verdict == "identified"
    assert [step.effect.id for step in shifted.steps] == [step.effect.id for step in plain.steps] == ["play", "gain"]
    assert numbers(shifted) == pytest.approx(numbers(plain), abs=1e-3)
    assert shifted.heldout_before_um == pytest.approx(plain.heldout_before_um, rel=1e-3)
    assert shifted.heldout_after_um == pytest.approx(plain.heldout_after_um, rel=1e-3)
    assert plain.constant is not None
    assert shifted.constant is not None
    assert shifted.constant.by_axis_um["x"] - plain.constant.by_axis_um["x"] == pytest.approx(shift_um, abs=0.01)


def test_the_mean_of_what_an_effect_does_is_no_part_of_it(tmp_path: Path) -> None:
    """The gain of the stage is 1 um on average, which is the gain's."""
    constant = diagnose(stage(tmp_path / "run.csv", 7.0), (), None, [GAIN, PLAY]).constant
    assert constant is not None
    assert constant.by_axis_um["x"] == pytest.approx(7.0, abs=0.2)


def test_the_family_of_effects_that_may_have_made_it_is_told(tmp_path: Path) -> None:
    diagnosis = diagnose(stage(tmp_path / "run.csv", 7.0), (), None, [GAIN, PLAY, OFFSET, ZERO])
    assert diagnosis.constant is not None
    assert diagnosis.constant.effects == ("offset", "zero")
    results = {candidate.effect: candidate for candidate in diagnosis.candidates}
    assert results["offset"].status == "not_testable"
    assert "constant" in results["offset"].why


def test_a_constant_alone_is_nothing_missing_where_a_zero_says_nothing(tmp_path: Path) -> None:
    diagnosis = diagnose(stage(tmp_path / "run.csv", 500.0, play_um=0.0), (), None, [GAIN, PLAY, OFFSET])
    assert (diagnosis.verdict, diagnosis.steps) == ("adequate", ())
    assert diagnosis.constant is not None
    assert diagnosis.constant.by_axis_um["x"] == pytest.approx(500.0, abs=0.2)


def test_with_the_constant_off_a_linear_description_does_not_beat_the_cause(tmp_path: Path) -> None:
    """A term `elevation + constant` beat a collimation error, which has no constant of its own."""
    rng = np.random.default_rng(3)
    elevation = rng.uniform(25, 75, ROWS)
    error = 60.0 / np.cos(np.radians(elevation)) - 110.0
    aligned = record_external(tmp_path / "sky.csv", {"elevation_deg": elevation}, {"x": error})
    collimation = along("x", "collimation", "k / cos(0.0174532925 * elevation_deg)")
    diagnosis = diagnose(aligned, (), None, [collimation])
    assert [step.effect.id for step in diagnosis.steps] == ["collimation"]
    assert diagnosis.verdict == "identified"
    assert diagnosis.depends_on == ()


def test_on_a_known_machine_it_stands_beside_effects_and_buys_no_step(tmp_path: Path) -> None:
    shift = np.tile([4.0, -3.0, 2.0], (200, 1))
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 30,)}, extra_um=shift)
    diagnosis = diagnose(aligned, (), None, EFFECTS)
    assert diagnosis.verdict == "identified"
    (step,) = diagnosis.steps
    assert step.effect.id == "link_elasticity"
    assert step.explained_fraction > 0.95  # of what the constant left
    assert diagnosis.constant is not None
    assert list(diagnosis.constant.by_axis_um.values()) == pytest.approx([4.0, -3.0, 2.0], abs=0.1)
    assert all(0 < std < 0.2 for std in diagnosis.constant.std_um.values())
    assert "reference_registration" in diagnosis.constant.effects
    assert diagnosis.constant.separated_by
    assert diagnosis.after.rms_um == pytest.approx(NOISE_UM, rel=0.1)


def test_alone_it_is_named_by_the_effects_that_make_it(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"tool_offset": (0.5, -0.4, 0.3)})
    diagnosis = diagnose(aligned, (), None, EFFECTS)
    assert diagnosis.verdict == "ambiguous"
    assert diagnosis.constant is None
    (step,) = diagnosis.steps
    family = {step.effect.id, *(rival.name for rival in step.rivals)}
    assert {"tool_offset", "link_zero"} <= family
    assert "backlash" not in family, "what any effect does with a constant, the constant does"
    assert "link_elasticity" not in family


def test_the_constant_of_an_external_model_is_told_on_every_axis(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    position = rng.uniform(0, 100, ROWS)
    errors = {"x": np.full(ROWS, 4.0), "y": np.full(ROWS, -3.0)}
    aligned = record_external(
        tmp_path / "run.csv", {"position_mm": position}, errors, model_mm={"x": position, "y": 2 * position}
    )
    constant = compd.diagnose(aligned).constant
    assert constant is not None
    assert dict(constant.by_axis_um) == pytest.approx({"x": 4.0, "y": -3.0}, abs=0.15)
