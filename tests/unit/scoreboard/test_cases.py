"""Which cases the scoreboard has: every family, every effect, no seed twice, and the same ones in every run."""

from __future__ import annotations

import pytest

from compd.simulation.causes.catalogue import CAUSES
from tests.scoreboard.case import CONSTANT_CAUSES, SEEDS_PER_FAMILY, THERMOMETERS
from tests.scoreboard.cases import FAMILIES, FIRST_SEED, cases, parse_case
from tests.scoreboard.external_machines import MACHINES
from tests.support.paths import ROOT

EXTERNAL = {cause for machine in MACHINES for cause in machine.causes}


@pytest.mark.parametrize("set_name", FIRST_SEED)
def test_a_set_has_the_cases_of_every_family(set_name):
    drawn = cases(list(FAMILIES), set_name)
    for name, family in FAMILIES.items():
        own = [case for case in drawn if case.family == name]
        assert len(own) == family.counts[set_name] <= SEEDS_PER_FAMILY
        assert all(cause in CAUSES or cause in EXTERNAL for case in own for cause in case.causes)


def test_no_seed_is_used_twice():
    seeds = [case.seed for set_name in FIRST_SEED for case in cases(list(FAMILIES), set_name)]
    assert len(seeds) == len(set(seeds))


def test_the_library_is_swept_with_every_strength():
    drawn = cases(["library"], "full")
    for name in (name for name, cause in CAUSES.items() if cause.in_library):
        assert {case.floors[0] for case in drawn if case.causes == (name,)} == {0.5, 1.0, 2.0, 4.0}


def test_tuning_and_test_have_other_strengths_of_an_effect():
    strengths = [{case.causes: case.floors for case in cases(["library"], name)} for name in ("tuning", "test")]
    assert all(strengths[0][cause] != strengths[1][cause] for cause in strengths[0])


def test_the_first_part_of_a_run_has_some_of_every_family():
    drawn = cases(list(FAMILIES), "full")
    assert {case.family for case in drawn[: len(drawn) // 10]} == set(FAMILIES)


def test_a_case_is_found_again_by_its_name():
    for case in cases(list(FAMILIES), "tuning"):
        assert parse_case(case.name) == case


def test_an_unknown_family_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match="family is one of library, nothing"):
        parse_case("fog:-:1")


def test_shifted_and_unregistered_recordings_hide_no_constant():
    hidden = {cause for case in cases(["shifted", "unregistered"], "full") for cause in case.causes}
    assert not hidden & set(CONSTANT_CAUSES)


def test_blind_cases_hide_what_needs_a_thermometer():
    assert {case.causes[0] for case in cases(["blind"], "full")} == set(THERMOMETERS)


def test_the_page_on_the_scoreboard_has_every_family_with_its_cases():
    page = (ROOT / "docs" / "explanation" / "how-often-it-is-right.md").read_text(encoding="utf-8")
    for name, family in FAMILIES.items():
        assert f"| `{name}` | {family.counts['full']} | " in page
