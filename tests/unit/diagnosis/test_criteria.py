"""Criteria: every threshold documented and used, and a changed one changes the verdict."""

from __future__ import annotations

import ast
from dataclasses import Field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import compd
from compd.comparison.criteria import ComparisonCriteria
from compd.diagnosis.criteria import Criteria
from compd.diagnosis.diagnose import diagnose
from compd.diagnosis.selection import explained_fraction, is_at_floor, is_plausible, is_undetermined, penalty
from tests.support.hidden_effects import LIBRARY, record_with_effects

ROOMS = [Path(compd.__file__).parent / room for room in ("comparison", "diagnosis")]
THRESHOLDS = [*fields(Criteria), *fields(ComparisonCriteria)]


@pytest.mark.parametrize("threshold", THRESHOLDS, ids=lambda threshold: threshold.name)
def test_every_threshold_says_what_it_means_in_which_unit_and_why(threshold: Field[Any]) -> None:
    assert set(threshold.metadata) == {"unit", "meaning", "reason"}
    assert all(text.strip() for text in threshold.metadata.values())


def test_every_threshold_is_used() -> None:
    trees = [ast.parse(path.read_text(encoding="utf-8")) for room in ROOMS for path in room.glob("*.py")]
    used = {node.attr for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    assert {threshold.name for threshold in THRESHOLDS} - used == set()


@pytest.mark.parametrize(
    ("changed", "verdict"),
    [
        ({"least_gain": 1e3}, "not_testable"),
        ({"most_at_floor": 0.5, "form_error": 0.0}, "unexplained"),
        ({"range_sigmas": -1e6, "range_slack": -1.0}, "unexplained"),
        ({"most_at_floor": 1e3}, "identified"),
        ({"rival_loss": 1e3, "rival_share": 1e3}, "ambiguous"),
    ],
    ids=lambda value: ", ".join(value) if isinstance(value, dict) else value,
)
def test_a_changed_threshold_changes_the_verdict(tmp_path: Path, changed: dict[str, float], verdict: str) -> None:
    aligned = record_with_effects(tmp_path / "run.csv", 1, {"link_elasticity": (1 / 30,)})
    criteria = replace(Criteria(), **changed)
    assert diagnose(aligned, (), None, list(LIBRARY.values()), criteria=criteria).verdict == verdict


def test_penalty_grows_with_what_is_explained() -> None:
    criteria = Criteria(least_gain=0.2, form_error=0.01)
    assert penalty(0.0, criteria) == 0.2
    assert penalty(100.0, criteria) == pytest.approx(1.0)
    assert penalty(100.0, criteria, factor=2.5) == pytest.approx(2.5)


def test_the_floor_is_wider_where_more_was_explained() -> None:
    criteria = Criteria(most_at_floor=1.25, form_error=0.01)
    assert is_at_floor(1.25, criteria)
    assert not is_at_floor(1.5, criteria)
    assert is_at_floor(1.5, criteria, explained=100.0)
    assert not is_at_floor(1.3, criteria, explained=-100.0)


def test_explained_fraction_is_a_share_of_what_is_above_the_floor() -> None:
    assert explained_fraction(5.0, 2.0) == pytest.approx(0.75)
    assert explained_fraction(5.0, 0.9) == 1.0
    assert explained_fraction(0.9, 0.5) == 0.0


def test_a_range_that_ends_at_zero_has_no_slack_there() -> None:
    criteria = Criteria(range_sigmas=3.0, range_slack=0.1)
    assert is_plausible((0.0, 1.0), 1.09, 0.0, criteria)
    assert not is_plausible((0.0, 1.0), 1.11, 0.0, criteria)
    assert not is_plausible((0.0, 1.0), -0.01, 0.001, criteria)
    assert is_plausible((0.0, 1.0), -0.01, 0.01, criteria)
    assert not is_plausible((0.0, 1.0), -0.01, float("nan"), criteria)


def test_parameters_are_undetermined_unless_one_is_known_better_than_its_range() -> None:
    limits = np.array([[0.0, 1.0], [0.0, 1.0]])
    assert is_undetermined(limits, np.array([2.0, np.nan]))
    assert not is_undetermined(limits, np.array([2.0, 0.5]))
