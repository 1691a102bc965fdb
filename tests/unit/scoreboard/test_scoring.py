"""Right, near and dangerous: what each kind of answer scores."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.scoreboard.case import CONSTANT_CAUSES, Case
from tests.scoreboard.expectation import Change, Expectation, expectation
from tests.scoreboard.scoring import intervals, score

NAMED = ("identified", "ambiguous", "partial")


def step(effect: str, *rivals: str, **more: Any) -> dict[str, Any]:
    return {"effect": effect, "rivals": list(rivals), "parameters": [], **more}


def result(
    expected: Expectation, verdict: str, *steps: dict[str, Any], family: str = "library", **more: Any
) -> dict[str, Any]:
    said = {
        "verdict": verdict,
        "steps": list(steps),
        "depends_on": [],
        "outlier_rows": [],
        "final_rms_um": 0.16,
        **more,
    }
    return {
        "case": "case",
        "family": family,
        "expected": json.loads(json.dumps(expected.as_json())),
        "verdict": said,
        "times_s": [10.0 * k for k in range(100)],
        "answer": {"effects": {}},
    }


def kinds(scored: dict[str, Any]) -> str:
    outcome = score(scored)
    return "right" if outcome.right else "dangerous" if outcome.dangerous else "near" if outcome.near else "missed"


SAG = Expectation(NAMED, (("link_sag",),))
CONSTANT = Expectation(NAMED, (CONSTANT_CAUSES,))
NOTHING = Expectation(("adequate",))
OUTSIDE = Expectation(("unexplained",), follows=(("humidity_pct",),), first=2)
BLIND = Expectation(("unexplained", "partial"), may_name=("link_expansion",))
HUMIDITY = {"covariate": "humidity_pct", "form": "linear"}
TIME = {"covariate": "time_s", "form": "linear"}


@pytest.mark.parametrize(
    ("scored", "kind"),
    [
        (result(SAG, "identified", step("link_sag")), "right"),
        (result(SAG, "ambiguous", step("link_sag", "scale_gain")), "right"),
        (result(SAG, "ambiguous", step("scale_gain", "link_sag")), "near"),
        (result(SAG, "unexplained", step("link_sag")), "near"),
        (result(SAG, "ambiguous", step("scale_gain", "backlash")), "missed"),
        (result(SAG, "unexplained"), "missed"),
        (result(SAG, "identified", step("scale_gain")), "dangerous"),
        (result(SAG, "identified", step("link_sag"), step("backlash")), "dangerous"),
        (result(SAG, "adequate"), "dangerous"),
        (result(CONSTANT, "identified", step("link_zero")), "right"),
        (result(CONSTANT, "identified", constant={"um": {"x": 1.0}, "effects": ["tool_offset"]}), "right"),
        (result(CONSTANT, "ambiguous", step("revolute_axis_tilt", "link_zero")), "near"),
        (result(NOTHING, "adequate"), "right"),
        (result(NOTHING, "unexplained"), "near"),
        (result(NOTHING, "ambiguous", step("backlash", "link_sag")), "missed"),
        (result(NOTHING, "identified", step("backlash")), "dangerous"),
        (result(OUTSIDE, "unexplained", depends_on=[TIME, HUMIDITY]), "right"),
        (result(OUTSIDE, "unexplained", depends_on=[TIME, TIME, HUMIDITY]), "near"),
        (result(OUTSIDE, "unexplained", depends_on=[{**TIME, "beside": ["humidity_pct"]}]), "right"),
        (result(OUTSIDE, "unexplained", step("link_sag"), depends_on=[HUMIDITY]), "missed"),
        (result(OUTSIDE, "adequate"), "dangerous"),
        (result(BLIND, "unexplained"), "right"),
        (result(BLIND, "partial", step("tool_expansion")), "missed"),
        (result(BLIND, "partial", step("tool_expansion", "link_expansion")), "near"),
        (result(BLIND, "identified", step("tool_expansion")), "dangerous"),
    ],
)
def test_what_an_answer_scores(scored, kind):
    assert kinds(scored) == kind


CHANGE = Expectation((*NAMED, "unexplained"), may_name=("backlash",), change=Change(("backlash",), 500.0))


@pytest.mark.parametrize(
    ("entries", "kind"),
    [
        ([{"form": "change", "effect": "backlash", "time_s": 500.0}], "right"),
        ([{"form": "change", "effect": "backlash", "time_s": 590.0}], "right"),
        ([{"form": "change", "effect": "backlash", "time_s": 620.0}], "near"),
        ([{"form": "change", "effect": "scale_gain", "time_s": 500.0}], "missed"),
        ([], "missed"),
    ],
)
def test_a_change_is_said_with_its_effect_and_its_time(entries, kind):
    assert kinds(result(CHANGE, "unexplained", depends_on=entries)) == kind


def test_a_step_in_time_is_an_offset_that_begins():
    expected = Expectation(("unexplained",), may_name=CONSTANT_CAUSES, change=Change(CONSTANT_CAUSES, 500.0))
    step_in_time = {**TIME, "form": "step", "formula_effect": {"formula": "k * (1 + sign(time_s - 503.4)) / 2 + c"}}
    assert kinds(result(expected, "unexplained", depends_on=[step_in_time])) == "right"
    assert kinds(result(expected, "unexplained", depends_on=[TIME])) == "missed"


def test_a_change_that_is_named_without_its_time_is_near():
    assert kinds(result(CHANGE, "partial", step("backlash"))) == "near"


@pytest.mark.parametrize(
    ("expected", "verdict", "more", "missing"),
    [
        (Expectation(NAMED, left_um=4.0), "partial", {"final_rms_um": 5.0}, "leaves 5 um, not 4"),
        (
            Expectation(NAMED, left_um=4.0),
            "partial",
            {"final_rms_um": 5.0, "depends_on": [{**TIME, "heldout_rms_um": 3.0}]},
            "",
        ),
        (Expectation(NAMED, gross_rows=2), "partial", {"outlier_rows": [3]}, "1 gross rows, not 2"),
        (Expectation(NAMED, constant=("plate_offset",)), "partial", {}, "not reported as a constant: plate_offset"),
        (
            Expectation(NAMED, constant_or=(("ia",), ("ie",))),
            "partial",
            {"constant": {"effects": ["ie"]}},
            "not reported as a constant: ia",
        ),
        (Expectation(NAMED, never=("tx",)), "partial", {"steps": [step("tx", "tf")]}, "named: tx"),
        (Expectation(NAMED, never_alone=("tx",)), "partial", {"steps": [step("tx")]}, "named: tx"),
        (Expectation(NAMED, never_alone=("tx",)), "partial", {"steps": [step("tx", "tf")]}, ""),
        (Expectation(NAMED), "partial", {"steps": [step("npae")]}, ""),
    ],
)
def test_what_a_real_recording_needs(expected, verdict, more, missing):
    assert "; ".join(score(result(expected, verdict, family="real", **more)).missing) == missing


def test_what_is_too_small_need_not_be_named():
    answer = {"answers": ["link_sag", "backlash"], "follows": [], "error_in_floors": {"link_sag": 0.2, "backlash": 2.0}}
    expected = expectation(Case("pair", ("link_sag", "backlash"), (2.0, 2.0), 1), answer, None)
    assert expected.groups == (("backlash",),)
    assert kinds(result(expected, "identified", step("backlash"))) == "right"
    assert kinds(result(expected, "identified", step("backlash"), step("link_sag"))) == "right"


def test_two_constants_are_one_family():
    answer = {
        "answers": ["link_zero", "tool_offset"],
        "follows": [],
        "error_in_floors": {"link_zero": 2, "tool_offset": 2},
    }
    assert expectation(Case("pair", ("link_zero", "tool_offset"), (2, 2), 1), answer, None).groups == (CONSTANT_CAUSES,)


def test_an_expectation_is_read_as_it_was_written():
    assert Expectation.from_json(CHANGE.as_json()) == CHANGE
    with pytest.raises(KeyError, match="unknown: colour; known: "):
        Expectation.from_json({"verdicts": ["adequate"], "colour": "red"})


def test_intervals_of_numbers_that_have_a_true_value():
    parameters = [{"value": 1.0, "std": 0.1}, {"value": 2.0, "std": 0.1}, {"value": 3.0, "std": None}]
    scored = result(CONSTANT, "identified", step("link_zero", parameters=parameters))
    scored["answer"] = {"effects": {"link_zero": [1.1, 2.5, 3.0]}}
    assert [inside for _, inside in intervals(scored)] == [True, False]


ONE_OF_TWO = Expectation(("likely", "ambiguous", "partial"), (("link_expansion",),), or_rival=True)
STEPS = Expectation(NAMED, (("stage_gain",),), left_um_at_least=0.1)
TOUCHED = Expectation(NAMED, (("link_sag",),), never_follows=("tip_z_mm",))
SMALL_ONES = Expectation(
    ("unexplained", *NAMED), may_name=("backlash", "link_sag"), or_rival=True, identified_needs=(("backlash",),)
)
HEIGHT = {"covariate": "tip_z_mm", "form": "linear"}


@pytest.mark.parametrize(
    ("scored", "kind"),
    [
        (result(ONE_OF_TWO, "likely", step("link_expansion")), "right"),
        (result(ONE_OF_TWO, "ambiguous", step("tool_expansion", "link_expansion")), "right"),
        (result(ONE_OF_TWO, "identified", step("link_expansion")), "dangerous"),
        (result(ONE_OF_TWO, "likely", step("tool_expansion")), "missed"),
        (result(ONE_OF_TWO, "ambiguous", step("link_expansion"), step("tool_expansion")), "near"),
        (result(STEPS, "identified", step("stage_gain")), "right"),
        (result(STEPS, "identified", step("stage_gain"), final_rms_um=4e-7), "dangerous"),
        (result(STEPS, "partial", step("stage_gain"), final_rms_um=0.05), "near"),
        (result(TOUCHED, "partial", step("link_sag"), depends_on=[TIME]), "right"),
        (result(TOUCHED, "partial", step("link_sag"), depends_on=[HEIGHT]), "near"),
        (result(TOUCHED, "unexplained", depends_on=[HEIGHT]), "missed"),
        (result(SMALL_ONES, "unexplained"), "right"),
        (result(SMALL_ONES, "partial", step("link_sag")), "right"),
        (result(SMALL_ONES, "partial", step("joint_contact", "link_sag")), "right"),
        (result(SMALL_ONES, "partial", step("joint_contact")), "missed"),
        (result(SMALL_ONES, "identified", step("backlash")), "right"),
        (result(SMALL_ONES, "identified", step("link_sag")), "dangerous"),
        (result(SMALL_ONES, "adequate"), "dangerous"),
    ],
)
def test_where_an_honest_analysis_says_less(scored, kind):
    assert kinds(scored) == kind


def hard(family: str, *causes: str, seed: int = 1, **more: Any) -> Expectation:
    floors = dict.fromkeys(causes, 3.0)
    answer = {"answers": list(causes), "follows": [], "error_in_floors": floors, "zero_is_unknown": False, **more}
    return expectation(Case(family, causes, tuple(floors.values()), seed), answer, 50.0)


def test_what_is_expected_of_hard_cases():
    assert "identified" not in hard("one-warm-up", "link_expansion").verdicts
    assert hard("rounded", "stage_gain", left_um=0.2, always_there=["stage_offset"]) == Expectation(
        ("identified", "likely", "ambiguous", "partial"),
        (("stage_gain",),),
        may_name=("stage_offset",),
        left_um_at_least=pytest.approx(0.14),
        or_rival=True,
    )
    assert hard("wrong-noise").verdicts == ("adequate", "unexplained")
    assert hard("wrong-noise", "backlash").groups == (("backlash",),)
    assert "tip_z_mm" in hard("plane", "link_sag").never_follows
    assert hard("re-mounted", "backlash").change == Change(CONSTANT_CAUSES, 50.0)
    assert hard("many-small", "backlash", "link_zero").identified_needs == (("backlash",), CONSTANT_CAUSES)
    assert hard("zero-elsewhere", "backlash").may_name == ()
    assert hard("zero-elsewhere", "backlash", zero_is_unknown=True).may_name == CONSTANT_CAUSES


def test_a_description_may_stand_for_a_cause_where_the_answer_says_so():
    drift = Expectation(NAMED, (("reference_drift", "time_s"),))
    assert kinds(result(drift, "partial", depends_on=[TIME])) == "right"
    assert kinds(result(drift, "partial", depends_on=[HUMIDITY])) == "missed"


def test_gross_rows_may_be_too_many():
    at_most_one = Expectation(NAMED, gross_rows_at_most=1)
    assert score(result(at_most_one, "partial", family="real", outlier_rows=[3, 4])).missing == (
        "2 gross rows, not at most 1",
    )
    assert score(result(at_most_one, "partial", family="real", outlier_rows=[3])).right
    assert Expectation.from_json(json.loads(json.dumps(at_most_one.as_json()))) == at_most_one
