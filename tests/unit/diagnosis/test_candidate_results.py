"""What is said of every effect that was tried, and why it is named or not."""

from __future__ import annotations

import numpy as np
import pytest

from compd.diagnosis.candidate_result import explained_fraction
from compd.diagnosis.findings import CandidateResult
from compd.diagnosis.recording_diagnosis import diagnose
from tests.support.external_recordings import along, record_external

ROWS = 240
RANGE = {"unit": "um", "plausible": [-0.5, 0.5], "source": "a test"}
PLAY = along("x", "play", "k * moved_1")
SAME = along("x", "latency", "k * moved_1 * 7", separated_by="another speed")
SMALL = along("x", "small", "k * temperature_room_degC", parameters={"k": RANGE})
HALF = along("x", "half", "k * (moved_1 + position_mm / 100)")
LOAD = along("x", "load", "k * force_x_N / 10")
OFFSET = along("x", "offset", "k")
HUMID = along("x", "humid", "k * humidity_pct")
ONCE = along("x", "once", "k * bump_1")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, CandidateResult]:
    """Of a stage with 3 um of play, at one speed, and 3 um / K of the room, a tenth of the rows of it to be had."""
    rng = np.random.default_rng(1)
    moved, position = rng.choice([-1.0, 1.0], ROWS), rng.uniform(-100, 100, ROWS)
    room = np.cumsum(rng.normal(0, 0.1, ROWS))
    columns = {
        "moved_1": moved,
        "position_mm": position,
        "temperature_room_degC": room,
        "force_x_N": rng.uniform(-10, 10, ROWS),
        "bump_1": np.where(np.arange(ROWS) == 50, 1.0, 0.0),
    }
    path = tmp_path_factory.mktemp("stage") / "run.csv"
    aligned = record_external(path, columns, {"x": 3 * moved + 3 * room})
    effects = [PLAY, SAME, SMALL, HALF, LOAD, OFFSET, HUMID, ONCE]
    return {result.effect: result for result in diagnose(aligned, (), None, effects).candidates}


def test_every_effect_has_a_result_the_best_first(results: dict[str, CandidateResult]) -> None:
    assert set(results) == {"play", "latency", "small", "half", "load", "offset", "humid", "once"}
    tried = [result.heldout_rms_um for result in results.values() if np.isfinite(result.heldout_rms_um)]
    assert tried == sorted(tried)


@pytest.mark.parametrize(
    ("effect", "status", "why"),
    [
        ("small", "partial", "only with implausible numbers: k = "),
        ("load", "no_gain", "not worth a name"),
        ("offset", "not_testable", "nothing on these rows but a constant"),
        ("humid", "not_testable", "needs humidity_pct"),
        ("once", "not_testable", "acts in one session or sector only"),
    ],
)
def test_an_effect_that_is_not_named_has_its_reason(
    results: dict[str, CandidateResult], effect: str, status: str, why: str
) -> None:
    assert (results[effect].status, why in results[effect].why) == (status, True)


def test_what_is_named_explains_and_so_does_its_rival(results: dict[str, CandidateResult]) -> None:
    named, rival = sorted((results["play"], results["latency"]), key=lambda result: "number" not in result.why)
    assert (named.status, named.why) == ("explains", "named, number 1")
    assert rival.status == "explains"
    assert rival.why.startswith(f"as good as {named.effect} on these rows")
    assert results["half"].status == "partial"
    assert results["half"].why == "nothing more beside what is named"


def test_what_could_not_be_tried_has_no_numbers(results: dict[str, CandidateResult]) -> None:
    assert np.isnan(results["humid"].heldout_rms_um)
    assert results["humid"].parameters == ()
    assert results["play"].parameters[0].value == pytest.approx(3.0, abs=0.5)
    assert results["play"].p_value < 0.05 < results["load"].p_value


def test_explained_fraction_is_a_share_of_what_is_above_the_floor() -> None:
    assert explained_fraction(5.0, 2.0, 1.0) == pytest.approx(0.75)
    assert explained_fraction(5.0, 0.9, 1.0) == 1.0
    assert explained_fraction(0.9, 0.5, 1.0) == 0.0
    assert explained_fraction(5.0, 2.0, 0.0) == pytest.approx(0.6)
    assert explained_fraction(5.0, 6.0, 1.0) == pytest.approx(-0.25)
