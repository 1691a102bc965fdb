"""The evidence of a diagnosis as a browser gets it: every number, every rival, in the words of the report."""

from __future__ import annotations

import json

import pytest

from compd.diagnosis import error_fall, summary_lines
from compd.diagnosis.words.summary_lines import MAX_LINES
from compd.report import evidence
from compd.report.diagnosis_evidence import formula_list, step_rows
from tests.support import diagnosis_situations as situations


@pytest.mark.parametrize("situation", situations.SITUATIONS)
def test_it_is_plain_data_that_says_what_the_report_says(situation):
    diagnosis = situation()
    answer = json.loads(json.dumps(evidence(diagnosis), allow_nan=False))
    assert answer["verdict"] == diagnosis.verdict
    assert answer["lines"] == summary_lines(diagnosis, on_page=True)
    assert len(answer["lines"]) <= MAX_LINES
    for number, effect in enumerate(answer["effects"]):
        report = dict(step_rows(number, diagnosis, error_fall(diagnosis)))
        shared = {"error, rows left out", "explains", "by noise alone"}
        assert {name: text for name, text in effect["facts"] if name in shared} == {k: report[k] for k in shared}
        assert (effect["equation"], effect["separated_by"]) == (report["equation"], report["told apart by"])
        assert len(effect["numbers"]) >= len(diagnosis.steps[number].parameters)
    assert "".join(formula["text"] for formula in answer["formulas"]) == formula_list(diagnosis)


def test_a_rival_comes_with_the_command_that_tells_it_apart():
    (effect,) = evidence(situations.rivals())["effects"]
    assert effect["rivals"] == [{"effect": "joint_contact", "alike": "99 %"}]
    assert "--rivals link_elasticity,joint_contact" in effect["plan_command"]
    assert evidence(situations.one_effect())["effects"][0]["plan_command"] == ""


def test_a_number_has_its_standard_error_and_the_range_in_which_it_may_be():
    (number,) = evidence(situations.one_effect())["effects"][0]["numbers"]
    assert number["text"] == "1.113 +- 0.021 ppm/K"
    assert number["range"].endswith(" ppm/K")
    assert number["plausible"]
    (number,) = evidence(situations.implausible())["effects"][0]["numbers"]
    assert not number["plausible"]


def test_the_error_on_all_rows_stands_beside_that_on_rows_left_out():
    diagnosis = situations.one_effect()
    facts = dict(evidence(diagnosis)["effects"][0]["facts"])
    assert facts["error, rows left out"] == "0.96 -> 0.18 um"
    assert facts["error, all rows"].endswith("with it")
    assert (
        "with all that is named" in dict(evidence(situations.two_effects())["effects"][0]["facts"])["error, all rows"]
    )


def test_a_description_comes_with_a_formula_to_try():
    answer = evidence(situations.described())
    assert answer["effects"] == []
    assert answer["follows"]["rows"]
    (formula,) = answer["formulas"]
    assert formula["declaration"]["id"] == formula["id"]
    assert formula["id"] in formula["text"]


def test_gross_rows_and_what_was_not_tested_are_told():
    assert "40 to 47" in evidence(situations.gross_rows())["gross"]
    names = [name for name, _ in evidence(situations.proxy())["untested"]["rows"]]
    assert names == ["link_expansion", "gauge_latency"]
    assert evidence(situations.one_effect())["untested"] is None
