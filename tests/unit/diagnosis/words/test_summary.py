"""The twelve lines and the sentence: ten situations word for word, and what must hold for every verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import pytest

from compd.diagnosis.findings import CandidateResult, ConstantFinding, GrossRows, UntestedEffect
from compd.diagnosis.verdict import Diagnosis, Verdict
from compd.diagnosis.words.phrases import physics_clause
from compd.diagnosis.words.summary_lines import MOST_LINES, WIDTH, summary_lines
from compd.model.library import load_library
from tests.support.diagnoses import (
    Noise,
    description,
    diagnosis,
    external_recording,
    formula,
    step,
    tripod_recording,
)

BACKLASH = formula("stage_backlash", "b * moved_1", "Play of screw and coupling: half of it on either side.")
GAIN = formula("stage_gain", "b * position_mm", "Lead of the screw, or a gear ratio.")
ZEROS = formula("joint_zero", "b * position_mm", "The encoders' zeros are elsewhere.")
LENGTHS = formula("link_length", "b * moved_1", "The arms are longer than drawn.")
FRAME = ("temperature_frame_degC", "temperature_bed_degC")
CONSTANT = ConstantFinding(
    {"x": 4.0, "y": -3.0, "z": 2.0},
    {"x": 0.1, "y": 0.1, "z": 0.1},
    ("tool_offset", "link_zero", "reference_registration"),
    "two attitudes of the tool",
)
VARY = "vary temperature_frame_degC alone, everything else as it is, at three places and back again"
CHANGE: dict[str, Any] = {
    "effect": "stage_backlash",
    "time_s": 6000.0,
    "formula_effects": (),
    "parameters": ({"b": 1.2},),
}
CONTRADICTION = "the repeats scatter 6 times as much as declared: check the instrument, or `sigma_um`"


def one_effect(sessions: int = 4) -> Diagnosis:
    steps = [step("link_expansion", [1.113], 0.021, 0.18)]
    return diagnosis("identified", 0.96, 0.18, Noise(0.16), tripod_recording(sessions), steps=steps)


def two_effects() -> Diagnosis:
    steps = [
        step("link_elasticity", [27.97], 0.29, 0.60),
        step("backlash", [0.884, 1.103, 0.795], 0.02, 0.157),
    ]
    return diagnosis("identified", 1.6, 0.157, Noise(0.155), steps=steps)


def rivals() -> Diagnosis:
    rows = [{"row": k, "tip_x_mm": 1.0} for k in range(12)]
    steps = [step("link_elasticity", [27.97], 0.29, 0.16, rivals={"joint_contact": 0.987})]
    return diagnosis("ambiguous", 0.68, 0.16, Noise(0.16, "declared"), steps=steps, next_measurement=rows)


def far_above_the_noise() -> Diagnosis:
    steps = [step(ZEROS, [4.2], 0.3, 73.0, links=0), step(LENGTHS, [9.1], 0.4, 55.0, links=0)]
    return diagnosis(
        "partial", 105.0, 55.0, Noise(20.0, "declared"), external_recording("xyz"), steps=steps, constant=CONSTANT
    )


def noise_not_known() -> Diagnosis:
    steps = [step(BACKLASH, [0.61], 0.02, 1.1, links=0), step(GAIN, [0.024], 0.0003, 0.112, links=0)]
    constant = ConstantFinding({"x": -3.2}, {"x": 0.1}, ("stage_offset",))
    noise = Noise(0.08, "estimate")
    return diagnosis("partial", 1.42, 0.112, noise, external_recording(), steps=steps, constant=constant)


def described() -> Diagnosis:
    return diagnosis(
        "unexplained",
        115.0,
        115.0,
        Noise(1.1),
        external_recording("z", quantities=FRAME),
        depends_on=[description(FRAME[0], "linear", 5.5, 0.998, beside=FRAME[1:])],
        next_measurement=[{"measure": VARY, "why": "the rest follows it"}],
    )


def proxy() -> Diagnosis:
    finding = description("temperature_frame_degC", "proxy", 0.2, 0.99, effect="link_expansion", formula_effects=())
    why = (
        "needs temperature_link_1_degC, which no gauge measures; needs temperature_link_2_degC, which no gauge measures"
    )
    untested = [UntestedEffect("link_expansion", why, True), UntestedEffect("gauge_latency", "needs moving rows")]
    return diagnosis("unexplained", 0.79, 0.79, Noise(0.16), depends_on=[finding], untested=untested)


def gross_rows() -> Diagnosis:
    rows = (*range(40, 48), 60, 61, 77)
    return diagnosis(
        "unexplained",
        66.5,
        66.5,
        Noise(1.3),
        external_recording("z", quantities=FRAME),
        depends_on=[description(FRAME[0], "linear", 12.0, 0.97)],
        gross=GrossRows(rows, ((40, 47),)),
        next_measurement=[{"measure": VARY, "why": "the rest follows it"}],
    )


def changed() -> Diagnosis:
    steps = [step(BACKLASH, [3.1], 0.1, 0.9, links=0)]
    finding = description("time_s", "change", 0.5, 0.9, **CHANGE)
    return diagnosis("partial", 2.6, 0.9, Noise(0.5), external_recording(), steps=steps, depends_on=[finding])


def nothing_missing() -> Diagnosis:
    untested = [UntestedEffect("gauge_latency", "needs moving rows")]
    return diagnosis("adequate", 0.165, 0.165, Noise(0.162), untested=untested)


def constant_alone() -> Diagnosis:
    return diagnosis("adequate", 0.165, 0.165, Noise(0.162), constant=CONSTANT)


def implausible() -> Diagnosis:
    steps = [step("reference_air_index", [-1.25], 0.3, 3.0, plausible=False)]
    return diagnosis("partial", 9.0, 3.0, Noise(0.9, contradiction=CONTRADICTION), steps=steps)


def nothing_varied() -> Diagnosis:
    untested = [UntestedEffect("link_elasticity", "needs force_x_N, which no gauge measures")]
    return diagnosis("not_testable", 2.0, 2.0, Noise(0.3, "declared"), untested=untested)


GOLDEN: dict[Callable[[], Diagnosis], str] = {
    one_effect: """
identified: What is missing is link_expansion: 0.96 -> 0.18 um
Found:    link_expansion: the rods between joints and scale grow with
            temperature
Explains: 99 % of the squared error above noise: 0.96 -> 0.18 um, rows left out
Left:     0.18 um; noise 0.16 um (repeats): only noise is left
Sure:     a = 1.113 +- 0.021 ppm/K; noise alone does this 1 time in 1000
Or else:  no other effect that was tried does as well
Next:     add it: compd effect add link_expansion --recording monday.csv --model
          FILE; try it on another day's recording: compd compare OTHER.csv
          --model FILE
""",
    two_effects: """
identified: What is missing is link_elasticity and backlash: 1.6 -> 0.16 um
Found:    link_elasticity (1.6 -> 0.60 um): a link stretches under its axial
            force
          backlash (0.60 -> 0.16 um): play between scale and link
Explains: 99 % of the squared error above noise: 1.6 -> 0.16 um, rows left out
Left:     0.16 um; noise 0.15 um (repeats): only noise is left
Sure:     link_elasticity k = 27.97 +- 0.29 N/um; backlash b_1 to b_3 = 0.884,
          1.103, 0.795 (+- 0.020) um; more below
Or else:  no other effect that was tried does as well
Next:     add it: compd effect add link_elasticity --recording monday.csv
          --model FILE, then backlash; try it on another day's recording: compd
          compare OTHER.csv --model FILE
""",
    rivals: """
ambiguous: link_elasticity or joint_contact is missing; these rows cannot tell
Found:    link_elasticity: a link stretches under its axial force; or
            joint_contact
Explains: 100 % of the squared error above noise: 0.68 -> 0.16 um, rows left out
Left:     0.16 um; noise 0.16 um (declared): only noise is left
Sure:     k = 27.97 +- 0.29 N/um; noise alone does this 1 time in 1000
Or else:  link_elasticity or joint_contact (99 % alike): these rows cannot tell
Next:     change nothing on the machine yet: what mends one does not mend its
          rival; measure the 12 rows below, which tell the rivals apart
""",
    far_above_the_noise: """
partial: joint_zero and link_length explain 75 %; something else acts as well
Shares:   joint_zero (105 -> 73 um): the encoders' zeros are elsewhere
          link_length (73 -> 55 um): the arms are longer than drawn
Explains: 75 % of the squared error above noise: 105 -> 55 um, rows left out
Left:     55 um; noise 20 um (declared): something else acts as well
Sure:     joint_zero b = 4.20 +- 0.30 um; link_length b = 9.10 +- 0.40 um; noise
          alone does each at most 1 time in 1000
Or else:  no other effect that was tried does as well
Besides:  a constant of (4.0, -3.0, 2.0) um: tool_offset, link_zero or the
          instrument's frame; these rows cannot tell
Next:     record what may drive the rest: temperatures, loads, directions; more
          below
""",
    noise_not_known: """
partial: stage_backlash and stage_gain explain 99 %; the noise is not known
Shares:   stage_backlash (1.4 -> 1.1 um): play of screw and coupling
          stage_gain (1.1 -> 0.11 um): lead of the screw
Explains: 99 % of the squared error: 1.4 -> 0.11 um, rows left out
Left:     0.11 um; how much of it is noise cannot be known
Sure:     stage_backlash b = 0.610 +- 0.020 um; stage_gain b = 0.02400 +-
          0.00030 um; noise alone does each at most 1 time in 1000
Or else:  no other effect that was tried does as well
Besides:  a constant of -3.2 um in x, which stage_offset can make
Next:     measure one point twice (two rows with the same number in a `visit`
          column); record what may drive the rest: temperatures, loads,
          directions; more below
""",
    described: """
unexplained: no effect that was tried explains the error of 115 um
Follows: temperature_frame_degC (linear) together with temperature_bed_degC: 115
         -> 5.5 um; a description, no cause
Left:    5.5 um with it; noise 1.1 um (repeats): something else acts as well
Sure:    temperature_frame_degC and temperature_bed_degC seen in one session
         only: measure on another day; noise alone does this 1 time in 1000
Next:    change nothing on the machine yet; vary temperature_frame_degC alone,
         everything else as it is, at three places and back again; until the
         cause is known, the formulas below lower the error
""",
    proxy: """
unexplained: no effect that was tried explains the error of 0.79 um
Follows: temperature_frame_degC, as link_expansion would, whose own temperature
         was not measured: 0.79 -> 0.20 um; a description, no cause
Left:    0.20 um with it; noise 0.16 um (repeats): something else acts as well
Sure:    noise alone does this 1 time in 1000
Or else: link_expansion may be behind it, and could not be tried; not testable
         here: gauge_latency
Next:    change nothing on the machine yet; link_expansion needs
         temperature_link_1_degC, which no gauge measures: record it
""",
    gross_rows: """
unexplained: no effect that was tried explains the error of 66 um
Follows: temperature_frame_degC (linear): 66 -> 12 um; a description, no cause
Left:    12 um with it; noise 1.3 um (repeats): something else acts as well
Gross:   11 of 120 rows do not count (up to 104 um off); look at what happened
         in rows 40 to 47 (a bump, a slipped target, a lost step); single bad
         readings: 60, 61 and 77
Sure:    temperature_frame_degC seen in one session only: measure on another
         day; noise alone does this 1 time in 1000
Next:    change nothing on the machine yet; vary temperature_frame_degC alone,
         everything else as it is, at three places and back again; until the
         cause is known, the formulas below lower the error
""",
    changed: """
partial: stage_backlash explains 91 %; something changed in time
Shares:   stage_backlash: play of screw and coupling
Changed:  from 6000 s on (row 62) stage_backlash is larger: something happened
          then; with it 0.90 -> 0.50 um
Explains: 91 % of the squared error above noise: 2.6 -> 0.90 um, rows left out
Left:     0.90 um; noise 0.50 um (repeats): some of it goes with the change
Sure:     b = 3.10 +- 0.10 um; noise alone does this 1 time in 1000
Or else:  no other effect that was tried does as well
Next:     find out what changed from 6000 s on (row 62); diagnose the rows
          before and after it apart; what was found may be added (compd effect
          add): it lowers the error, the rest stays
""",
    nothing_missing: """
adequate: nothing is missing; the error of 0.17 um is noise
Left:    0.17 um; noise 0.16 um (repeats): only noise is left
Or else: not testable here: gauge_latency
Next:    nothing to mend or to add; other loads, temperatures or speeds may show
         more
""",
    constant_alone: """
adequate: nothing is missing but a constant; what varies is noise
Left:    0.17 um; noise 0.16 um (repeats): only noise is left
Besides: a constant of (4.0, -3.0, 2.0) um: tool_offset, link_zero or the
         instrument's frame; these rows cannot tell
Next:    to tell where the constant is from: two attitudes of the tool; nothing
         to mend or to add; other loads, temperatures or speeds may show more
""",
    implausible: """
partial: reference_air_index explains 90 %; something else acts as well
Shares:   reference_air_index: an instrument that is not told the air's
            temperature and pressure takes a wrong wavelength
Explains: 90 % of the squared error above noise: 9.0 -> 3.0 um, rows left out
Left:     3.0 um; noise 0.90 um (repeats): something else acts as well; the
          repeats scatter 6 times as much as declared: check the instrument, or
          `sigma_um`
Sure:     k = -1.25 +- 0.30, IMPLAUSIBLE: 0 to 1.5 is usual; noise alone does
          this 1 time in 1000
Or else:  no other effect that was tried does as well
Next:     record what may drive the rest: temperatures, loads, directions; do
          not add reference_air_index: something else looks like it
""",
    nothing_varied: """
not_testable: no effect can be tested; nothing that drives one was varied
Left:    2.0 um; noise 0.30 um (declared): these rows do not show what acts
Or else: link_elasticity needs force_x_N, which no gauge measures
Next:    vary one thing after the other: place, direction, load, temperature
""",
}


@pytest.mark.parametrize("situation", GOLDEN, ids=lambda situation: situation.__name__)
def test_the_lines_word_for_word(situation: Callable[[], Diagnosis]) -> None:
    assert summary_lines(situation()) == GOLDEN[situation].strip("\n").split("\n")


def test_one_session_proves_no_thermal_cause() -> None:
    lines = " ".join(" ".join(summary_lines(one_effect(sessions=1))).split())
    assert "link_expansion seen in one session only: measure on another day" in lines
    assert "Next: measure on another day first; add it:" in lines
    assert "one session" not in " ".join(summary_lines(two_effects()))


SITUATIONS = list(GOLDEN)


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
    if verdict not in ("identified", "ambiguous", "partial"):
        variants += [replace(made, steps=()), replace(made, steps=(), depends_on=(), constant=None)]
    for variant in variants:
        lines = summary_lines(variant)
        assert len(lines) <= MOST_LINES
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
    assert summary_lines(made)[0] == "not_testable: no effect that was tried lowers the error; the noise is not known"
    assert made.summary.endswith("No effect that was tried lowers it.")


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
