"""The twelve lines of a diagnosis word for word, in every situation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from compd.diagnosis.findings import CandidateResult
from compd.diagnosis.verdict import Diagnosis
from compd.diagnosis.words.summary_lines import summary_lines
from tests.support.diagnosis_situations import (
    SITUATIONS,
    changed,
    constant_alone,
    described,
    far_above_the_noise,
    gross_rows,
    implausible,
    noise_not_known,
    nothing_missing,
    nothing_varied,
    one_effect,
    proxy,
    rivals,
    two_effects,
)

GOLDEN: dict[Callable[[], Diagnosis], str] = {
    one_effect: """
identified: What is missing is link_expansion: 0.96 -> 0.18 um
Found:    link_expansion: the rods between joints and scale grow with
            temperature
Explains: 99 % of the squared error above noise: 0.96 -> 0.18 um, rows left out
Left:     0.18 um; noise 0.16 um (repeats): only noise is left
Sure:     a = 1.113 +- 0.021 ppm/K; noise alone does this 1 time in 1000
Or else:  no other effect that was tried does as well
Next:     add it: compd model add link_expansion --recording monday.csv --model
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
Next:     add it: compd model add link_elasticity --recording monday.csv --model
          FILE, then backlash; try it on another day's recording: compd compare
          OTHER.csv --model FILE
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
Sure:     joint_zero b = 4.20 +- 0.30 um/mm; link_length b = 9.10 +- 0.40 um;
          noise alone does each at most 1 time in 1000
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
          0.00030 um/mm; noise alone does each at most 1 time in 1000
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
         in rows 40 to 47 with 4 % of the squared error (a bump, a slipped
         target, a lost step); single bad readings: 60, 61 and 77
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
          before and after it apart; what was found may be added (compd model
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


def test_every_situation_has_its_lines() -> None:
    assert set(GOLDEN) == set(SITUATIONS)


def test_what_is_left_has_limits_for_another_day_where_they_are_known() -> None:
    lines = summary_lines(replace(one_effect(), left_interval_um=(0.16, 0.21)))
    left = " ".join(" ".join(lines).split())
    assert "Left: 0.18 um (another day: 0.16 to 0.21 um with 90 %); noise 0.16 um (repeats): only noise" in left


def test_an_effect_that_is_too_small_for_a_name_is_in_the_heading_beside_a_constant() -> None:
    small = CandidateResult("backlash", "too_small", "takes 0.02 um", 0.164, math.nan, 1e-6, ())
    heading, *lines = summary_lines(replace(constant_alone(), candidates=(small,)))
    assert heading == "adequate: nothing is missing but a constant; what varies is near the noise"
    assert "backlash may act, too little for a name" in " ".join(" ".join(lines).split())
