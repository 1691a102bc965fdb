"""Rows in the page: left out with a reason and back again, thinned for pictures, complete for numbers."""

from __future__ import annotations

import json

import numpy as np
import pytest

from compd.errors import RecordingError, StateError
from compd.page.workbench.handlers import MAX_ROWS_BYTES
from compd.page.workbench.opened_recording import MAX_PICTURED
from compd.page.workbench.workbench import Workbench
from compd.recording import read_recording
from tests.support.measured import gauges, hidden, record


@pytest.fixture
def path(tmp_path):
    return record(tmp_path, gauges(300, 1), [hidden("link_expansion", 2.0)])


@pytest.fixture
def workbench(path, tmp_path):
    return Workbench(path, tmp_path / "tripod.model.yaml", None)


def test_rows_are_left_out_and_count_again(workbench, path):
    used, rms = workbench.summary()["used"], workbench.summary()["rms"]
    after = workbench.exclude([10, 11, 12], "the beam was cut", workbench.revision)
    assert after["used"] == used - 3
    assert after["excluded"] == {"10": "the beam was cut", "11": "the beam was cut", "12": "the beam was cut"}
    assert read_recording(path).sidecar.excluded[11] == "the beam was cut"
    again = workbench.include([10, 11, 12], workbench.revision)
    assert (again["used"], again["rms"], again["excluded"]) == (used, rms, {})


@pytest.mark.long
def test_very_many_rows_are_left_out_at_once(tmp_path):
    path = record(tmp_path, gauges(6_000, 1), [])
    workbench = Workbench(path, tmp_path / "tripod.model.yaml", None)
    every_other = list(range(2, 6_000, 2))
    assert len(workbench.exclude(every_other, "fog", workbench.revision)["excluded"]) == len(every_other)
    assert len(json.dumps({"rows": list(range(100_002)), "reason": "fog"})) < MAX_ROWS_BYTES


def test_what_leaves_nothing_to_compare_is_taken_back(workbench, path):
    sidecar = path.with_suffix(".yaml").read_bytes()
    everything = workbench.opened.aligned.recording.row.tolist()
    with pytest.raises(RecordingError):
        workbench.exclude(everything, "all of it", workbench.revision)
    assert path.with_suffix(".yaml").read_bytes() == sidecar
    assert workbench.summary()["used"] > 200


def test_strange_rows_and_old_states_are_refused(workbench):
    with pytest.raises(RecordingError, match="row 5000"):
        workbench.exclude([5000], "fog", workbench.revision)
    with pytest.raises(StateError, match="changed elsewhere"):
        workbench.exclude([10], "fog", workbench.revision - 1)


def test_what_a_command_has_changed_is_seen_at_the_next_opening(workbench, path, tmp_path):
    from compd.api import add_effect

    workbench.refresh()
    revision = workbench.revision
    add_effect(None, "link_expansion", path).write(tmp_path / "tripod.model.yaml")
    workbench.refresh()
    assert workbench.revision == revision + 1
    assert [number["effect"] for number in workbench.summary()["numbers"]] == ["link_expansion"]
    workbench.undo(workbench.revision)
    revision = workbench.revision
    workbench.refresh()
    assert workbench.revision == revision, "its own change is no surprise"


@pytest.mark.long
@pytest.mark.sample
def test_a_long_recording_is_thinned_for_pictures_and_numbers_are_of_all_rows(tmp_path):
    path = record(tmp_path, gauges(12_000, 1), [hidden("link_expansion", 2.0)])
    workbench = Workbench(path, tmp_path / "tripod.model.yaml", None)
    header, every = (json.loads(workbench.opened.rows(all_rows=every).partition(b"\n")[0]) for every in (False, True))
    assert header["arrays"][0]["shape"] == [MAX_PICTURED]
    assert every["arrays"][0]["shape"] == [12_000]
    assert workbench.candidates.ranked()[0]["effect"] == "link_expansion"
    trial = workbench.candidates.trial("link_expansion", 0)
    comparison = workbench.opened.comparison
    left = comparison.residual_um - trial.columns_um @ np.array([1.3])
    assert np.isclose(trial.rms_um(np.array([1.3])), np.sqrt(np.mean(left[comparison.used] ** 2)), rtol=1e-9)
    assert trial.values == 3 * int(comparison.used.sum())


def test_effects_that_do_the_same_here_are_named_with_the_card(workbench):
    card = workbench.candidates.card("link_expansion")
    assert all(0.95 <= other["cosine"] <= 1 for other in card["alike"])
    assert "link_expansion" not in [other["effect"] for other in card["alike"]]
    assert workbench.candidates.summary()["left_out_rms"] > 2 * card["variants"][0]["left_out_rms"]
