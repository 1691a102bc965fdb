"""A recording in the page: numbers as of `compd compare`, trials that are exact, steps as of `compd model`."""

from __future__ import annotations

import json

import numpy as np
import pytest

from compd.api import add_effect, compare
from compd.comparison import open_recording
from compd.errors import CompdError, StateError
from compd.model_file import read_stored
from compd.page.workbench.workbench import Workbench
from tests.support.measured import gauges, hidden, record


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording"), gauges(300, 1), [hidden("link_expansion", 2.0)])


@pytest.fixture
def workbench(path, tmp_path):
    return Workbench(path, tmp_path / "tripod.model.yaml", None)


def unpacked(data):
    line, _, rest = data.partition(b"\n")
    header, arrays, begin = json.loads(line), {}, 0
    for array in header["arrays"]:
        size = 4 * int(np.prod(array["shape"]))
        arrays[array["name"]] = np.frombuffer(rest[begin : begin + size], "<f4").reshape(array["shape"])
        begin += size
    assert begin == len(rest)
    return header, arrays


def test_numbers_are_those_of_compare(workbench, path):
    answer, comparison = workbench.summary(), compare(open_recording(path))
    assert (answer["rms"], answer["floor"]) == (comparison.rms_um, comparison.floor.um)
    assert (answer["rows"], answer["used"]) == (300, int(comparison.used.sum()))
    _, rows = unpacked(workbench.opened.rows())
    assert np.allclose(rows["residual"], comparison.residual_um, atol=1e-4, equal_nan=True)
    assert rows["place_mm"].shape == (300, 3)
    assert "quantity temperature_room_degC" in rows


def test_the_effect_that_is_there_is_first(workbench):
    ranked = workbench.candidates.ranked()
    assert ranked[0]["effect"] == "link_expansion"
    assert ranked[0]["explained"] > 0.9
    assert {"effect", "status", "why", "left_out_rms", "explained", "physics"} == set(ranked[0])


def test_the_error_of_a_trial_is_that_of_its_residual(workbench):
    trial = workbench.candidates.trial("link_expansion", 0)
    comparison = workbench.opened.comparison
    for theta in ([0.0], [1.3], [2.0]):
        left = comparison.residual_um - trial.columns_um @ np.array(theta)
        assert np.isclose(trial.rms_um(np.array(theta)), np.sqrt(np.mean(left[comparison.used] ** 2)), rtol=1e-9)
    card = workbench.candidates.card("link_expansion")
    best = np.array(card["variants"][0]["theta"])
    assert abs(best[0] - 2.0) < 5 * card["variants"][0]["standard_error"][0]
    assert trial.rms_um(best) < 1.2 * comparison.floor.um
    _, arrays = unpacked(trial.pack(workbench.opened.pictured, {}))
    assert np.allclose(arrays["columns"], trial.columns_um, rtol=1e-5, atol=1e-5)


def test_a_step_is_told_first_then_made_as_the_command_makes_it(workbench, path, tmp_path):
    model = tmp_path / "tripod.model.yaml"
    answer = workbench.propose("add", "link_expansion")
    assert answer["rms"][1] < 0.5 * answer["rms"][0]
    assert not model.exists()
    made = workbench.make("add", "link_expansion", workbench.revision)
    by_command = add_effect(None, "link_expansion", path)
    assert [number["value"] for number in made["numbers"]] == [number.value for number in by_command.numbers()]
    assert read_stored(model).steps[0].rms_after_um == by_command.steps[0].rms_after_um
    assert made["rms"] == pytest.approx(answer["rms"][1], rel=1e-12)
    undone = workbench.undo(workbench.revision)
    assert undone["numbers"] == []
    assert [step["kind"] for step in undone["ledger"]] == ["add", "undo"]


def test_of_two_browsers_the_second_is_told_that_it_shows_what_was(workbench):
    revision = workbench.revision
    workbench.make("add", "link_expansion", revision)
    with pytest.raises(StateError, match="changed elsewhere"):
        workbench.make("add", "scale_gain", revision)


def test_a_model_with_code_is_refused_and_the_code_does_not_run(path, tmp_path):
    ran = tmp_path / "ran"
    code = tmp_path / "mine.py"
    code.write_text(f"open({str(ran)!r}, 'w')\n")
    model = tmp_path / "tripod.model.yaml"
    model.write_text(
        f"format: 2\nmachine: tripod-cmm\neffects:\n- {{effect: '{code}:MINE', parameters: []}}\ncovariance: []\n"
    )
    with pytest.raises(CompdError, match="executes no file"):
        Workbench(path, model, None)
    assert not ran.exists()


def test_what_the_rows_support_is_added_without_a_warning_and_what_they_do_not_with_the_verdict(workbench):
    assert workbench.effects()["noise"] == ""
    assert {effect["warning"] for effect in workbench.effects()["effects"]} == {None}, "it takes a diagnosis"
    assert workbench.doubt("link_expansion", [])["warning"] == ""
    said = workbench.doubt("link_sag", [])["warning"]
    assert "link_sag is not named. identified: What is missing is link_expansion" in said
    workbench.make("add", "link_expansion", workbench.revision)
    offered = workbench.effects()
    assert offered["noise"].startswith("Nothing is missing")
    assert {effect["explained"] for effect in offered["effects"]} == {None}
    first = offered["effects"][0]
    assert first["warning"].endswith(f"is not named. adequate: {offered['noise']}")
    assert workbench.doubt(first["effect"], [])["warning"] == first["warning"]


def test_the_fall_is_from_the_machine_without_effects_on_rows_that_count_in_both(workbench):
    before = workbench.summary()
    assert before["fall"]["rms"] == pytest.approx([before["rms"]] * 2)
    assert (before["fall"]["rows"], before["fall"]["differ"]) == (before["used"], "")
    made = workbench.make("add", "link_expansion", workbench.revision)
    assert made["fall"]["rms"] == [pytest.approx(before["rms"], rel=0.02), pytest.approx(made["rms"], rel=0.02)]
    assert bool(made["fall"]["differ"]) == (made["used"] != before["used"])
    _, rows = unpacked(workbench.opened.rows())
    assert np.abs(rows["residual"]).mean() < np.abs(rows["start"]).mean()


def test_a_doubt_follows_steps_that_another_workbench_has_made(workbench, path, tmp_path):
    doubter = Workbench(path, tmp_path / "tripod.model.yaml", None)
    assert doubter.doubt("link_expansion", [])["warning"] == ""
    workbench.make("add", "link_expansion", workbench.revision)
    (first, *_) = workbench.effects()["effects"]
    assert doubter.doubt(first["effect"], [])["warning"] == first["warning"] != ""
