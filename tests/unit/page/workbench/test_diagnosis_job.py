"""A diagnosis beside the page: steps, result, page, end; and only so many at once."""

from __future__ import annotations

import gzip
import subprocess
import sys

import pytest

from compd.diagnosis import STAGES
from compd.errors import StateError
from compd.page.workbench.diagnoses import MAX_RUNNING, Diagnoses
from compd.page.workbench.diagnosis_job import DiagnosisJob
from tests.support.daemon_process import Pidfds
from tests.support.measured import gauges, hidden, record
from tests.support.patience import PATIENCE_S


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return record(tmp_path_factory.mktemp("recording"), gauges(200, 1), [hidden("link_expansion", 5.0)])


def test_its_steps_its_result_and_its_page(path):
    job = DiagnosisJob(path, None, None)
    job.join(PATIENCE_S)
    answer, outcome = job.summary(), job.outcome()
    assert answer["state"] == "done", outcome["printed"]
    assert [stage["text"] for stage in answer["stages"]] == list(STAGES)
    assert answer["steps"][0]["text"] == STAGES[0]
    assert {step["text"] for step in answer["steps"]} <= set(STAGES)
    assert [step["at_s"] for step in answer["steps"]] == sorted(step["at_s"] for step in answer["steps"])
    assert outcome["result"]["verdict"] == outcome["evidence"]["verdict"] == "identified"
    assert "link_expansion" in outcome["printed"]
    assert answer["page"] is True
    page = gzip.decompress(job.page).decode()
    assert page.startswith("<!doctype html>")
    assert "link_expansion" in page
    assert job.has_ended


@pytest.mark.long
@pytest.mark.sample
def test_effects_of_ones_own_are_tried_too(path, tmp_path):
    own = tmp_path / "own.effects.yaml"
    own.write_text(
        "{id: swelling, port: link, formula: k * humidity_pct,"
        " parameters: {k: {unit: um, plausible: [0, 1], source: s}}}"
    )
    job = DiagnosisJob(path, None, None, effects=(str(own),))
    job.join(PATIENCE_S)
    assert "swelling" in [candidate["effect"] for candidate in job.outcome()["result"]["candidates"]]


def test_a_person_ends_it(path):
    job = DiagnosisJob(path, None, None)
    assert job.summary()["page"] is None
    job.cancel()
    job.join(PATIENCE_S)
    assert job.summary()["state"] == "cancelled"
    assert job.summary()["page"] is False
    assert job.outcome()["printed"] == ""


def test_what_cannot_be_opened_is_told(tmp_path):
    job = DiagnosisJob(tmp_path / "none.csv", None, None)
    job.join(PATIENCE_S)
    assert job.summary()["state"] == "failed"
    assert "none.csv" in job.outcome()["printed"]


def test_more_than_a_few_at_once_are_refused_and_there_is_room_after_an_end(path):
    diagnoses = Diagnoses()
    jobs = [diagnoses.begin(path, None, None, 0) for _ in range(MAX_RUNNING)]
    try:
        with pytest.raises(StateError, match=f"{MAX_RUNNING} run already.*") as refusal:
            diagnoses.begin(path, None, None, 0)
        assert path.stem in str(refusal.value)
        jobs[0].cancel()
        jobs[0].join(PATIENCE_S)
        jobs.append(diagnoses.begin(path, None, None, 0))
        assert jobs[-1].state == "running"
    finally:
        for job in jobs:
            job.cancel()
            job.join(PATIENCE_S)


PARENT = """
import multiprocessing
from compd.page.workers.workers import end_with_the_parent
child = multiprocessing.get_context("spawn").Process(target=end_with_the_parent, daemon=True)
child.start()
print(child.pid, flush=True)
child.join()
"""


def test_its_process_ends_when_the_server_is_killed():
    """Whatever it does just then: a stage may take minutes, in which it tells nobody anything."""
    with subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True) as parent:
        child = int(parent.stdout.readline())
        with Pidfds([child]) as ended:
            parent.kill()
            ended.wait_for_ends()
