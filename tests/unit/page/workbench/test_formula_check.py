"""A formula as it is typed: each problem at its field, with its place; names that become parameters."""

from __future__ import annotations

import pytest

from compd.page.workbench.formula_check import check
from compd.page.workbench.formula_questions import offered
from compd.page.workbench.workbench import Workbench
from tests.support.measured import gauges, hidden, record

K = {"unit": "um/pct", "plausible": [0, 1], "source": "notes"}
GOOD = {"id": "swelling", "port": "link", "formula": "k * (humidity_pct - 50)", "parameters": {"k": K}}


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    path = record(tmp_path_factory.mktemp("recording"), gauges(60, 1), [hidden("link_expansion", 2.0)])
    return Workbench(path, path.with_name("no.model.yaml"), None).opened.aligned.rows


def problems(rows, **changed):
    return check({**GOOD, **changed}, rows).problems


def only(rows, **changed):
    (problem,) = problems(rows, **changed)
    return problem


def test_what_is_right_has_no_problem(rows):
    checked = check(GOOD, rows)
    assert checked.problems == ()
    assert checked.effect.id == "swelling"


@pytest.mark.parametrize(
    ("changed", "field", "character", "words"),
    [
        ({"formula": "k * $humidity_pct"}, "formula", 5, "is not part of a formula"),
        ({"formula": "k * reference_x_mm"}, "formula", 5, "would show the effect the answer"),
        ({"formula": "k * humdity_pct"}, "formula", None, "did you mean humidity_pct?"),
        ({"id": "A b"}, "id", None, "is no name"),
        ({"port": "nowhere"}, "port", None, "none of the choices"),
        ({"gives": "inch"}, "gives", None, "none of the choices"),
        ({"thing": 1}, "", None, "unknown key"),
    ],
)
def test_a_problem_is_at_its_field(rows, changed, field, character, words):
    problem = only(rows, **changed)
    assert (problem.field, problem.character) == (field, character)
    assert words in problem.text


@pytest.mark.parametrize(
    ("parameter", "part"),
    [
        ({"plausible": [None, 1]}, "low"),
        ({"plausible": [0, "x"]}, "high"),
        ({"unit": 3}, "unit"),
        ({"per": "x"}, "per"),
    ],
)
def test_a_problem_of_a_parameter_is_at_its_part(rows, parameter, part):
    problem = only(rows, parameters={"k": {**K, **parameter}})
    assert (problem.field, problem.parameter, problem.part) == ("parameters", "k", part)


def test_a_problem_of_one_axis_is_at_that_axis(rows):
    problem = only(rows, port="tool", formula={"x": "k * humidity_pct", "y": "k * ("})
    assert (problem.field, problem.axis, problem.character) == ("formula", "y", 5)


def test_a_field_that_is_wrong_hides_no_mistake_in_the_formula(rows):
    mistakes = problems(rows, id="", formula="k * (humidity_pct", parameters={"k": {**K, "plausible": [None, None]}})
    assert {problem.field for problem in mistakes} == {"id", "formula", "parameters"}


def test_names_that_are_no_columns_become_parameters(rows):
    checked = check({**GOOD, "formula": "k * sin(2 * pi * tip_x_mm / p) + 1e5 * q * humidity_pct"}, rows)
    assert checked.missing == ("p", "q")


def test_what_would_take_minutes_is_not_tried(rows):
    formula = "k * sin(a * tip_x_mm) * exp(b * tip_y_mm) * sin(c * tip_z_mm)"
    problem = only(rows, formula=formula, parameters=dict.fromkeys("kabc", K))
    assert "729 combinations" in problem.text


@pytest.mark.parametrize(
    "changed",
    [
        {"formula": 5},
        {"formula": None},
        {"formula": []},
        {"formula": {}},
        {"formula": {"x": 3}},
        {"formula": "k" * 400},
        {"parameters": []},
        {"parameters": {"k": 3}},
        {"parameters": {"": K}},
        {"parameters": {"a.b": K}},
        {"parameters": {"k": {**K, "plausible": [float("nan"), 10**400]}}},
        {"port": ["link"]},
        {"axis": "x"},
        {"id": None},
        {"id": {}},
    ],
)
def test_whatever_is_sent_has_an_answer_in_words(rows, changed):
    mistakes = problems(rows, **changed)
    assert mistakes
    assert all(problem.text for problem in mistakes)


def test_what_may_be_named_is_what_was_recorded(rows):
    ports = {port["port"]: port for port in offered(rows)["ports"]}
    names = {name: [column["name"] for column in port["columns"]] for name, port in ports.items()}
    assert "temperature_link" in names["link"]
    assert "temperature_link" not in names["tool"]
    assert "reading_mm" in names["joint"]
    assert {"humidity_pct", "tip_x_mm"} <= set(names["tool"])
    assert not any(name.startswith("reference_") for port in names.values() for name in port)
    for port, columns in names.items():
        formula = " + ".join(f"k * {column}" for column in columns[:8])
        assert problems(rows, port=port, formula={"x": formula} if ports[port]["axes"] else formula) == ()
