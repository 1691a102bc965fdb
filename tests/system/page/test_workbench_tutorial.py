"""The tutorial with the mouse: a hidden effect on a simulated machine is found, added, run as a shadow and adopted.

Nothing here knows what is hidden; the sealed answer is opened at the end. The commands do the same on the same
recording, and write the same ledger.
"""

from __future__ import annotations

import json
import shutil

import pytest

from compd.model_file import read_stored
from tests.support.hidden_run import hidden_run
from tests.support.hidden_visits import check_visits, survey_visits
from tests.support.live_page import page_process, until
from tests.support.simulated import run_directory
from tests.support.workbench_page import SHOWN

pytestmark = pytest.mark.long

# What the tutorial of the command line hides, too.
HIDDEN = 125


def order(tab, name, done):
    """Give an order of the machine's panel: what it would do first, then yes."""
    tab.locator(f"#{name}").click()
    until(tab, "document.querySelector('#confirm-order')?.disabled === false")
    tab.locator("#confirm-order").click()
    until(tab, f"document.querySelector('#live-model .order-answer').textContent === {json.dumps(done)}")


def test_a_hidden_effect_is_found_added_and_adopted_by_mouse_with_the_ledger_of_the_commands(chromium):
    with (
        run_directory() as directory,
        hidden_run(directory, "--seed", "1", "--speedup", "200", "--hidden", str(HIDDEN)) as run,
    ):
        recording, before_um = run.survey(survey_visits(2, 40, heaters=True), "survey")
        recordings = run.directory / "recordings"
        recordings.mkdir()
        for suffix in (".csv", ".yaml"):
            shutil.copy(recording.with_suffix(suffix), recordings)
        machine = run.directory / run.configuration.name
        with page_process(machine, recordings, "--models", str(run.directory)) as (address, _):
            tab = chromium.new_context(viewport={"width": 1440, "height": 1000}).new_page()
            tab.goto(address)
            tab.locator("nav a", has_text="Workbench").click()
            until(tab, "document.getElementById('recording').options.length === 1")
            tab.locator("#open").click()
            until(tab, SHOWN)
            first = tab.locator(".effect").first
            effect = first.get_attribute("data-effect")
            first.click()
            until(tab, "bench.trial")
            tab.locator("#fit").click()
            assert tab.evaluate("bench.tried_rms") < tab.evaluate("bench.summary.rms")
            tab.locator("#add").click()
            tab.locator("#confirm").click()
            until(tab, f"bench.summary?.ledger.length === 1 && {SHOWN}")
            until(tab, "document.getElementById('arm')?.disabled === false")
            tab.locator("#arm").click()
            until(tab, "document.getElementById('arm').textContent === 'Disarm'")
            order(tab, "live-shadow", "Done: run as a shadow.")
            until(tab, "document.getElementById('live-models').textContent.includes('this model as it is')")
            order(tab, "live-adopt", "Done: adopt the shadow's model.")
        after_um = run.tip_error_um(check_visits(3, 10, heaters=True))
        run.compd(
            *("model", "add", effect, "--recording", recordings / "survey.csv"),
            *("--machine", machine, "--model", run.directory / "by-command.model.yaml"),
        )
        by_mouse = read_stored(run.directory / "survey.model.yaml")
        by_command = read_stored(run.directory / "by-command.model.yaml")
        assert by_mouse.state == by_command.state
        ledgers = [
            [(step.kind, step.effect, step.recording, step.rms_before_um, step.rms_after_um) for step in model.steps]
            for model in (by_mouse, by_command)
        ]
        assert ledgers[0] == ledgers[1]
        assert after_um < by_mouse.steps[0].noise_floor_um < before_um
        secret = json.loads((run.directory / "hidden.answer.json").read_text(encoding="utf-8"))
        assert effect in secret["answers"]
