"""What competes: effects whose inputs were recorded and that move the prediction, at each choice of their constants."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compd.comparison import AlignedRecording, open_recording
from compd.diagnosis.candidate_criteria import CandidateCriteria
from compd.diagnosis.candidates.candidates import (
    CandidatePool,
    library_pool,
)
from compd.diagnosis.criteria import Criteria
from compd.units import UM_PER_MM
from tests.support.candidate_sets import candidate, columns
from tests.support.external_recordings import along, record_external
from tests.support.hidden_effects import LIBRARY, record_with_effects

ROWS = 100
BED = along("x", "bed", "k * (temperature_bed_degC - 20) / 10")
PLAY = along("x", "play", "k * moved_1")


def recording(path: Path, bed: np.ndarray) -> AlignedRecording:
    moved = np.where(np.arange(ROWS) % 2 == 0, 1.0, -1.0)
    return record_external(path / "run.csv", {"temperature_bed_degC": bed, "moved_1": moved}, {"x": moved})


def test_columns_are_what_each_parameter_does_within_its_plausible_range(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {}, visits=40)
    (found,) = library_pool(aligned, [LIBRARY["link_zero"]], ()).candidates
    np.testing.assert_array_equal(found.columns_um, aligned.columns(LIBRARY["link_zero"], {}) * UM_PER_MM)
    assert found.limits.tolist() == [list(column.parameter.theta_range) for column in found.effect.columns(3)]
    assert (found.name, found.kind, found.parameter_count) == ("link_zero", "effect", 3)
    assert (found.largest == np.abs(found.limits).max(axis=1)).all()


def test_effects_of_the_model_do_not_compete(tmp_path: Path) -> None:
    pool = library_pool(recording(tmp_path, np.linspace(20, 40, ROWS)), [BED, PLAY], {"bed"})
    assert [each.name for each in pool.candidates] == ["play"]
    assert pool.untestable == {}


def test_every_value_of_a_searched_constant_competes_and_the_search_has_its_price(tmp_path: Path) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {}, visits=40)
    lags = library_pool(aligned, [LIBRARY["link_expansion_lag"]], ()).candidates
    assert len({each.constants["tau"] for each in lags}) == len(lags) > 3
    assert {each.parameter_count for each in lags} == {
        lags[0].columns_um.shape[2] + CandidateCriteria.searched_constant
    }
    chosen = library_pool(aligned, [LIBRARY["joint_runout"]], ()).candidates
    constants = {constant.name for constant in LIBRARY["joint_runout"].constants if constant.choice}
    assert constants
    assert {each.searched_parameters for each in chosen} == {CandidateCriteria.searched_choice * len(constants)}


def test_the_price_of_an_effect_is_that_of_its_kind_and_of_its_numbers() -> None:
    criteria = Criteria(effect_price=1.0, description_price=2.0, number_price=0.1)
    assert candidate("a", columns(1)).price(criteria) == 1.0
    assert candidate("a", columns(1, 3), searched_parameters=2).price(criteria) == pytest.approx(1.4)
    assert candidate("a", columns(1), kind="description").price(criteria) == 2.0


def test_a_missing_column_is_said_by_name(tmp_path: Path) -> None:
    humid = along("x", "humid", "k * humidity_pct")
    pool = library_pool(recording(tmp_path, np.linspace(20, 40, ROWS)), [humid], ())
    assert pool.candidates == ()
    assert pool.untestable == {"humid": "needs humidity_pct, which no gauge measures"}


def test_what_never_changed_is_to_be_varied(tmp_path: Path) -> None:
    pool = library_pool(recording(tmp_path, np.full(ROWS, 20.0)), [BED, PLAY], ())
    assert [each.name for each in pool.candidates] == ["play"]
    assert pool.untestable == {"bed": "what drives it stayed at its reference value: vary it"}
    least = CandidateCriteria.min_motion_um / 10  # k = 100 makes 10 um / K
    pool = library_pool(recording(tmp_path, np.full(ROWS, 20.0 + 1.1 * least)), [BED], ())
    assert [each.name for each in pool.candidates] == ["bed"]


@pytest.mark.parametrize(("empty", "competes"), [(1, True), (10, True), (11, False)])
def test_a_few_empty_cells_leave_an_effect_in_and_many_do_not(tmp_path: Path, empty: int, competes: bool) -> None:
    bed = np.linspace(20, 40, ROWS)
    bed[:empty] = np.nan
    pool = library_pool(recording(tmp_path, bed), [BED], ())
    assert bool(pool.candidates) == competes
    if not competes:
        assert pool.untestable == {"bed": "what it needs is empty in 11 % of the rows"}


def test_a_searched_period_has_to_be_seen_to_repeat(tmp_path: Path) -> None:
    """A sine of 50 mm over 30 mm is a slope with a bend: it took the place of a wrong lead."""
    size = {"unit": "um", "plausible": [-50, 50], "source": "a test"}
    cycle = along(
        "x",
        "cycle",
        "a * sin(2 * pi * tip_x_mm / p) + b * cos(2 * pi * tip_x_mm / p)",
        parameters={"a": size, "b": size, "p": {"unit": "mm", "plausible": [0.2, 50], "source": "a test"}},
    )
    places = np.linspace(-15, 15, ROWS)

    def over(path: Path, share: float) -> CandidatePool:
        still = {"x": np.zeros(ROWS)}
        return library_pool(record_external(path, {}, still, model_mm={"x": share * places}), [cycle], ())

    pool = over(tmp_path / "run.csv", 1.0)
    assert pool.candidates
    assert max(each.constants["p"] for each in pool.candidates) < 40
    assert {each.searched_parameters for each in pool.candidates} == {CandidateCriteria.searched_constant}
    pool = over(tmp_path / "short.csv", 1e-3)
    assert not pool.candidates
    assert "less than one period" in pool.untestable["cycle"]


def test_an_instruments_frame_is_no_candidate_where_it_is_fitted_along(tmp_path: Path) -> None:
    registration = LIBRARY["reference_registration"]
    aligned = record_with_effects(tmp_path / "run.csv", 1, {}, visits=40)
    assert library_pool(aligned, [registration], ()).candidates
    text = (tmp_path / "run.yaml").read_text().replace("frame: machine", "frame: instrument")
    (tmp_path / "run.yaml").write_text(text)
    pool = library_pool(open_recording(tmp_path / "run.csv"), [registration], ())
    assert "fitted along" in pool.untestable["reference_registration"]
