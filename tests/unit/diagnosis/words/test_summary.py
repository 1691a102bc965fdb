"""The twelve lines and the sentence: what must hold for every verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import pytest

from compd.diagnosis.findings import CandidateResult, GrossRows, UntestedEffect
from compd.diagnosis.named_probability import NamedProbability
from compd.diagnosis.probability_criteria import ProbabilityCriteria
from compd.diagnosis.verdict import Diagnosis, Verdict
from compd.diagnosis.words.phrases import physics_clause
from compd.diagnosis.words.summary import summary
from compd.diagnosis.words.summary_lines import MAX_LINES, WIDTH, summary_lines
from compd.model.library import load_library
from tests.support.diagnoses import Noise, description, diagnosis, external_recording, formula, step
from tests.support.diagnosis_situations import (
    BACKLASH,
    CHANGE,
    CONSTANT,
    CONTRADICTION,
    SITUATIONS,
    changed,
    far_above_the_noise,
    nothing_missing,
    one_effect,
    rivals,
    two_effects,
)


def test_one_session_proves_no_thermal_cause() -> None:
    lines = " ".join(" ".join(summary_lines(one_effect(sessions=1))).split())
    assert "link_expansion seen in one session only: measure on another day" in lines
    assert "Next: measure on another day first; add it:" in lines
    assert "one session" not in " ".join(summary_lines(two_effects()))


def test_a_stated_probability_has_a_line_and_another_one_without_effects() -> None:
    named = replace(one_effect(), probability_from=NamedProbability(0.0))
    (line,) = [line for line in summary_lines(named) if line.startswith("Right")]
    assert f"{named.probability:.2f} is the probability that what is named is all" in line
    nothing = replace(nothing_missing(), probability_from=NamedProbability(0.0))
    assert any("that no effect of the library has to be" in line for line in summary_lines(nothing))
    assert not [line for line in summary_lines(one_effect()) if line.startswith("Right")]


@pytest.mark.parametrize(("odds", "said"), [(-20.0, "0.01"), (20.0, "0.99")])
def test_no_probability_is_said_to_be_certain(odds: float, said: str) -> None:
    criteria = ProbabilityCriteria(certain=odds)
    made = replace(one_effect(), probability_from=NamedProbability(0.0, criteria=criteria))
    assert any(line.startswith(f"Right:    {said} is") for line in summary_lines(made))


def test_what_is_likely_says_why() -> None:
    doubtful = NamedProbability(1.0, criteria=ProbabilityCriteria(certain=0.5, per_better=0.0))
    made = replace(one_effect(), verdict="likely", probability_from=doubtful)
    assert summary_lines(made)[0].startswith("likely: link_expansion is missing, one more recording decides")
    assert "probability 0.62" in summary(made)
    once = replace(one_effect(sessions=1), verdict="likely")
    assert "seen in one warm-up only" in summary_lines(once)[0]
    assert "One warm-up proves no cause" in summary(once)


@pytest.mark.parametrize("situation", SITUATIONS, ids=lambda situation: situation.__name__)
def test_the_sentence_claims_no_more_than_the_verdict(situation: Callable[[], Diagnosis]) -> None:
    made = situation()
    said = made.summary
    assert ("What is missing is" in said) == (made.verdict == "identified")
    assert ("Nothing is missing" in said) == (made.verdict == "adequate")
    assert said.count(". ") <= 2
    if made.verdict == "partial":
        assert "something else acts as well" in said or "cannot be known" in said
    if made.verdict == "unexplained":
        assert said.startswith("No effect that was tried explains")


@pytest.mark.parametrize("verdict", get_args(Verdict))
@pytest.mark.parametrize("source", ["repeats", "declared", "estimate"])
def test_every_verdict_fits_whatever_there_is_to_say(verdict: Verdict, source: str) -> None:
    name = "a_name_of_an_effect_that_somebody_made_up_and_that_is_longer_than_a_line_of_a_terminal_"
    physics = "Something that takes very many words to say and more than one line " * 3
    steps = [
        step(
            formula(f"{name}{k}", "b * position_mm", physics),
            [-1e-3 * k],
            1e-5,
            1e3 / k,
            links=0,
            rivals={f"{name}{other}": 0.99 for other in range(10, 20)},
            plausible=k % 2 == 0,
        )
        for k in range(1, 8)
    ]
    change = description("time_s", "change", 0.5, 0.9, **CHANGE)
    follows = description(f"{name}pct", "linear", 12.0, 0.97, beside=(f"{name}mm", f"{name}N"))
    made = diagnosis(
        verdict,
        12345.6,
        123.4,
        Noise(1.3, source, CONTRADICTION),
        external_recording("xyz"),
        steps=steps,
        depends_on=[change, follows],
        constant=replace(CONSTANT, effects=tuple(f"{name}{k}" for k in range(9)), separated_by=physics),
        gross=GrossRows(tuple(range(2, 60)), ((2, 9), (12, 20), (30, 40))),
        untested=[UntestedEffect(f"{name}{k}", physics, k < 4) for k in range(9)],
        next_measurement=[{"measure": physics, "why": physics}],
    )
    variants = [made]
    if verdict not in ("identified", "likely", "ambiguous", "partial"):
        variants += [replace(made, steps=()), replace(made, steps=(), depends_on=(), constant=None)]
    for variant in variants:
        lines = summary_lines(variant)
        assert len(lines) <= MAX_LINES
        assert max(map(len, lines)) <= WIDTH
        assert lines[0].startswith(f"{verdict}: ")
        assert lines[-1].startswith(" ") or lines[-1].startswith("Next:")
        assert not any(word in " ".join(lines) for word in ("nan", "None", "()", "  ;"))


def test_an_unknown_noise_is_never_called_noise() -> None:
    for verdict in ("adequate", "unexplained", "not_testable"):
        made = diagnosis(verdict, 2.0, 2.0, Noise(0.3, "estimate"))
        text = " ".join(" ".join(summary_lines(made)).split())
        assert "cannot be known" in text
        assert "measure one point twice (two rows with the same number in a `visit` column)" in text
        assert "0.3" not in text
        assert "nothing is missing" not in (made.summary + text).lower()


def test_what_was_tried_without_gain_is_not_called_untestable() -> None:
    tried = (CandidateResult("backlash", "no_gain", "takes 0 % of the error away"),)
    made = diagnosis("not_testable", 2.0, 2.0, Noise(0.3, "estimate"), candidates=tried)
    assert (
        summary_lines(made)[0]
        == "not_testable: no effect that was tried surely lowers the error; the noise is not known"
    )
    assert made.summary.endswith("No effect that was tried surely lowers it.")


def test_rows_are_promised_only_where_there_are_any() -> None:
    assert "measure the 12 rows below" in " ".join(summary_lines(rivals()))
    text = " ".join(" ".join(summary_lines(replace(rivals(), next_measurement=()))).split())
    assert "rows below" not in text
    assert "to tell link_elasticity: loads of 20, 60 and 120 N at one place" in text


def test_a_formula_without_words_is_told_from_its_rival_by_a_plan() -> None:
    steps = [step(BACKLASH, [0.6], 0.02, 0.2, links=0, rivals={"stage_windup": 1.0})]
    made = diagnosis("ambiguous", 1.4, 0.2, Noise(0.2), external_recording(), steps=steps)
    text = " ".join(" ".join(summary_lines(made)).split())
    assert "compd plan stage.csv --rivals stage_backlash,stage_windup says what tells them apart" in text


def test_effects_inside_a_machine_are_not_said_to_one_with_a_model_of_its_own() -> None:
    untested = [
        UntestedEffect("plate_bending", "acts inside a machine"),
        UntestedEffect("my_growth", "needs humidity_pct"),
    ]
    lines = summary_lines(diagnosis("adequate", 1.0, 1.0, Noise(1.0), external_recording(), untested=untested))
    assert "Or else: not testable here: my_growth" in lines


def test_a_single_driver_and_several_agree_with_their_verb() -> None:
    assert "stage_backlash explains" in changed().summary
    assert "joint_zero and link_length explain " in far_above_the_noise().summary


@pytest.mark.parametrize("effect", load_library().values(), ids=lambda effect: effect.id)
def test_every_effect_of_the_library_says_its_physics_in_a_clause(effect: Any) -> None:
    clause = physics_clause(effect)
    assert clause[0].islower() or clause[1].isupper()
    assert 15 < len(clause) < 100
    assert not clause.endswith((".", ",", ":"))


def test_a_formula_without_words_says_itself() -> None:
    assert physics_clause(formula("mine", "b * position_mm", "")) == "delta = b * position_mm, along x"


@pytest.mark.parametrize(
    ("effect", "values", "place"),
    [
        ("scale_gain", [0.4, -1.1, 27.7], "scale_gain (scale 3: +28 ppm)"),
        ("scale_gain", [-27.7, 1.0, 0.4], "scale_gain (scale 1: -28 ppm)"),
        ("scale_gain", [15.0, 1.0, 27.7], "scale_gain"),
        ("scale_gain", [0.4, 0.3, 2.0], "scale_gain"),
        ("base_joint_position", [0.001] * 3 + [0.05, -0.08, 0.01] + [0.002] * 3, "base_joint_position (base joint 2)"),
        ("tool_offset", [0.1, 0.0, 0.0], "tool_offset"),
    ],
    ids=["one scale", "less", "two scales", "none is sure", "a joint has three numbers", "no link of its own"],
)
def test_the_headline_says_at_which_link_or_joint_an_effect_acts(effect: str, values: list[float], place: str) -> None:
    found = step(effect, values, 1.0 if effect == "scale_gain" else 0.001, 0.2)
    made = diagnosis("identified", 1.4, 0.2, Noise(0.2), steps=[found])
    assert made.summary.startswith(f"What is missing is {place}: with it")
    heading = f"identified: What is missing is {place}: 1.4 -> 0.20 um"
    assert (summary_lines(made)[0] == heading) is (len(heading) <= WIDTH)


def test_numbers_outside_their_ranges_and_undetermined_ones_are_in_the_headline() -> None:
    found = step("scale_gain", [27.7, 3.0, 2.0], 1.0, 0.2)
    near, far, unknown = found.parameters
    numbers = (
        replace(near, low=0.0, high=20.0),
        replace(far, low=-30.0, high=30.0),
        replace(unknown, low=0.0, high=0.5),
    )
    made = diagnosis("partial", 1.4, 0.2, Noise(0.1), steps=[replace(found, parameters=numbers)])
    assert summary_lines(made)[0].endswith("see what speaks against its numbers")
    assert "k_1 of scale_gain is 27.7 +- 1.0 ppm, and 0 to 20 is usual" in made.summary
    assert made.summary.endswith("these rows do not determine k_3 of scale_gain.")
