"""The reliability of stated probabilities: what a calibrated verdict, an overconfident one and a constant score."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from docs.pictures import reliability as picture
from tests.scoreboard.case import Case
from tests.scoreboard.hard_cases import ROUNDED
from tests.scoreboard.prepare import prepare
from tests.scoreboard.reliability import MIN_CASES, UNSTATED, lines, named_set_is_right, reliability
from tests.scoreboard.trial import run

SAG = {"verdicts": ["identified"], "groups": [["link_sag"]]}


def result(named, expected=None, probability=None, family="library", constant=(), rivals=()):
    verdict = {"verdict": "identified", "steps": [{"effect": name, "rivals": list(rivals)} for name in named]}
    verdict |= {"constant": {"effects": list(constant)}, "probability": probability}
    return {"family": family, "expected": expected or SAG, "verdict": verdict, "answer": {"weak_disturbances": {}}}


def stated(probabilities, is_right):
    return [
        result(["link_sag" if right else "backlash"], probability=probability)
        for probability, right in zip(probabilities, is_right, strict=True)
    ]


@pytest.fixture
def calibrated():
    rng = np.random.default_rng(1)
    probabilities = rng.uniform(0, 1, 4000)
    return stated(probabilities, rng.uniform(size=4000) < probabilities)


@pytest.mark.parametrize(
    ("scored", "right"),
    [
        (result(["link_sag"]), True),
        (result(["link_sag", "backlash"]), False),
        (result(["backlash"], rivals=["link_sag"]), False),
        (result([]), False),
        (result([], {"verdicts": ["adequate"]}), True),
        (result(["backlash"], {"verdicts": ["adequate"]}), False),
        (
            result([], {"verdicts": ["identified"], "groups": [["tool_offset", "link_zero"]]}, constant=["link_zero"]),
            True,
        ),
        (result(["backlash"], {**SAG, "or_rival": True}, rivals=["link_sag"]), False),
        (result(["backlash"], {**SAG, "groups": [], "may_name": ["backlash"]}), True),
        (
            result([], {"verdicts": ["partial"], "may_name": ["link_sag"], "identified_needs": [["link_sag"]]}),
            False,
        ),
    ],
)
def test_a_set_is_right_where_it_is_whole_and_has_nothing_else(scored, right):
    assert named_set_is_right(scored) is right


def test_what_is_calibrated_is_found_to_be(calibrated):
    found = reliability(calibrated)
    assert found.cases == 4000
    assert len(found.bins) == 10
    assert all(each.is_calibrated and each.cases >= MIN_CASES for each in found.bins)
    # uniform probabilities: 1/6 in place of 1/4
    assert found.brier == pytest.approx(1 / 6, abs=0.01)
    assert found.constant_brier == pytest.approx(1 / 4, abs=0.01)
    assert found.reduction == pytest.approx(1 / 3, abs=0.03)


def test_what_is_too_sure_is_found_to_be():
    found = reliability(stated([0.99] * 100, [True] * 70 + [False] * 30))
    (each,) = found.bins
    assert (each.cases, each.right) == (100, pytest.approx(0.7))
    assert not each.is_calibrated
    assert found.reduction < 0


def test_bins_with_few_cases_are_put_together():
    found = reliability(stated([0.05] * 49 + [0.35] + [0.95] * 60 + [0.99] * 10, [False] * 50 + [True] * 70))
    assert [(each.least, each.most, each.cases) for each in found.bins] == [
        (0.0, pytest.approx(0.4), 50),
        (pytest.approx(0.4), pytest.approx(1.0), 70),
    ]
    found = reliability(stated([0.05] * 60 + [0.95] * 49, [False] * 60 + [True] * 49))
    assert [each.cases for each in found.bins] == [109]


def test_a_probability_of_one_is_in_the_last_bin():
    assert [each.cases for each in reliability(stated([1.0] * 60, [True] * 60)).bins] == [60]


def test_real_recordings_and_verdicts_without_a_probability_do_not_count():
    assert reliability([result(["link_sag"]), result(["link_sag"], probability=0.9, family="real")]) is None
    assert [*lines(None)] == [UNSTATED]


def test_the_table_states_bins_and_both_scores(calibrated):
    table = "\n".join(lines(reliability(calibrated)))
    assert "| 0.0 to 0.1 | " in table
    assert "| 0.9 to 1.0 | " in table
    assert table.count("| yes |") == 10
    assert "Brier score 0.1" in table


def test_the_diagram_has_a_point_per_bin_where_it_belongs(calibrated):
    found = reliability(calibrated)
    drawn = ElementTree.fromstring(picture.draw(json.loads(json.dumps(found.as_json()))))
    points = drawn.findall("{http://www.w3.org/2000/svg}circle")
    assert len(points) == len(found.bins)
    for point, each in zip(points, found.bins, strict=True):
        x, y = picture.place(each.stated, each.right)
        assert (float(point.get("cx")), float(point.get("cy"))) == pytest.approx((x, y), abs=0.1)


def test_the_committed_picture_is_that_of_the_counted_figures():
    if not picture.FIGURES.exists():
        pytest.skip(f"{picture.FIGURES.name} has not been counted: python -m tests.scoreboard --figures writes it")
    assert picture.PICTURE.read_text(encoding="utf-8") == picture.picture()


def test_a_verdict_states_a_probability(tmp_path: Path):
    verdict = run(prepare(Case(ROUNDED, ("stage_gain",), (8.0,), 3), tmp_path))["verdict"]
    if "probability" not in verdict:
        pytest.skip("the verdict's JSON has no key `probability`")
    assert 0.0 <= verdict["probability"] <= 1.0
