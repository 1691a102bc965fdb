"""A case from its recording to the page and to the table of sensitivities."""

from __future__ import annotations

import json
import operator

import pytest
import yaml

from compd.diagnosis import Criteria
from compd.model.library import load_effects
from tests.scoreboard.case import Case
from tests.scoreboard.page import write_page
from tests.scoreboard.prepare import prepare
from tests.scoreboard.real import prepare_real
from tests.scoreboard.scoring import score
from tests.scoreboard.sensitivity import FACTORS, UNCHANGED, Variant, changed, figures, table, thresholds, variants
from tests.scoreboard.table import report
from tests.scoreboard.trial import prepared, read_answer, run

SHORT = Case("short", ("link_elasticity",), (4.0,), 7)


@pytest.fixture(scope="module")
def campaigns(tmp_path_factory):
    directory = tmp_path_factory.mktemp("campaigns")
    prepare(SHORT, directory)
    return directory


@pytest.fixture(scope="module")
def result(campaigns):
    return json.loads(json.dumps(run(prepared(campaigns)[0])))


@pytest.mark.long
def test_a_case_has_two_recordings_and_an_answer_apart_from_them(campaigns):
    (directory,) = prepared(campaigns)
    assert {path.name for path in directory.iterdir()} == {
        *("train.csv", "train.yaml", "other.csv", "other.yaml"),
        "answer.json",
    }
    assert len((directory / "train.csv").read_text().splitlines()) == 91
    assert "link_elasticity" not in (directory / "train.csv").read_text() + (directory / "train.yaml").read_text()
    assert read_answer(directory)["expected"]["groups"] == [["link_elasticity"]]


@pytest.mark.long
def test_a_case_that_is_there_is_not_made_again(campaigns):
    answer = prepared(campaigns)[0] / "answer.json"
    before = answer.stat().st_mtime_ns
    prepare(SHORT, campaigns)
    assert answer.stat().st_mtime_ns == before


@pytest.mark.long
def test_the_diagnosis_of_a_case_is_scored(result):
    assert result["case"] == SHORT.name
    assert score(result).near
    assert result["other_floor_ratio"] < 2.0


@pytest.mark.long
def test_a_miss_is_on_the_page_with_what_was_hidden_and_said(result, tmp_path):
    missed = result | {"verdict": result["verdict"] | {"verdict": "adequate", "steps": [], "said": "It <is> fine."}}
    write_page(tmp_path / "page.html", [result, missed], tmp_path)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert f'<details id="{SHORT.name}" class="dangerous">' in page
    assert "link_elasticity: " in page
    assert "times the noise" in page
    assert "adequate: It &lt;is&gt; fine." in page
    assert "python -m tests.scoreboard --case &#39;short:link_elasticityx4:7&#39;" in page


@pytest.mark.long
def test_the_tables_count_families_and_misses(result):
    missed = result | {"verdict": result["verdict"] | {"verdict": "adequate", "steps": []}}
    text = report([result, missed])
    assert "| short | 90 rows without repeats | 2 | 1 (50 %) | 1 | 1 | 90 % |" in text
    assert "| short:link_elasticityx4:7 | adequate |  | DANGEROUS: not named: link_elasticity;" in text


def test_a_variant_changes_one_threshold():
    assert changed(Variant("", UNCHANGED)) == Criteria()
    assert len(variants()) == 1 + len(FACTORS) * len(thresholds())
    for variant in variants()[1:]:
        different = [
            name
            for name in thresholds()
            if operator.attrgetter(name)(changed(variant)) != operator.attrgetter(name)(Criteria())
        ]
        assert different == [variant.name]


def test_the_sensitivities_are_a_row_per_threshold():
    name = next(iter(thresholds()))
    line = {"case": "a", "right": True, "near": True, "dangerous": False}
    lines = list(
        table([line | {"name": "", "change": UNCHANGED}, line | {"name": name, "change": "half", "right": False}])
    )
    assert lines[0] == "As it is, right/near/dangerous of all: 1/1/0 of 1."
    assert lines[4].startswith(f"| `{name}` | ")
    assert lines[4].endswith(" | 0/1/0 of 1 | - |")
    assert len(lines) == 4 + len(thresholds())


def test_the_documentation_gets_the_thresholds_that_were_counted_whole():
    name = next(iter(thresholds()))
    line = {"case": "a", "right": True, "near": True, "dangerous": False}
    changes = [("", UNCHANGED), (name, "half"), (name, "twice")]
    counted = figures([line | {"name": number, "change": change} for number, change in changes], every=8)
    assert counted["command"] == 'make sensitivity OPTIONS="--every 8"'
    assert counted["cases"] == 1
    assert counted["as it is"] == "1/1/0"
    assert counted["thresholds"] == {name: {"half": "1/1/0", "twice": "1/1/0"}}


def test_real_recordings_are_cases_too(tmp_path):
    entry = {"library": "plate", "verdict": ["partial"], "right": [["plate_scale"]], "constant": ["plate_offset"]}
    known = {"library": None, "right": [["ca"]]}
    (tmp_path / "answers.yaml").write_text(yaml.safe_dump({"disc": entry, "disc with ia ie in the model": known}))
    for suffix in ("csv", "yaml"):
        (tmp_path / f"disc.{suffix}").write_text("")
    first, second = prepare_real(tmp_path / "cases", tmp_path)
    assert "plate_offset" in load_effects(first / "effects.yaml")
    assert read_answer(first)["expected"] == {
        "verdicts": ["partial"],
        "groups": [["plate_scale"]],
        "constant": ["plate_offset"],
    }
    assert json.loads((second / "known.json").read_text()) == ["ia", "ie"]


def test_without_real_recordings_there_are_no_such_cases(tmp_path):
    assert prepare_real(tmp_path, tmp_path / "absent") == []
