"""From a recording to the machine that runs: an effect is added, run as a shadow and adopted, with the mouse alone."""

from __future__ import annotations

from contextlib import contextmanager

import pytest

from compd.client import connect
from compd.configuration import load_machine
from tests.support.live_page import LivePage, page_process, until
from tests.support.measured import gauges, hidden, record
from tests.support.patience import PATIENCE_S
from tests.support.workbench_page import SHOWN, open_recording

pytestmark = pytest.mark.long

ZEROS_UM = (12.0, -8.0, 5.0)


@pytest.fixture
def directory(tmp_path):
    (tmp_path / "recordings").mkdir()
    record(tmp_path / "recordings", gauges(300, 1), [hidden("link_zero", *ZEROS_UM)], name="monday-1")
    return tmp_path


@pytest.fixture
def daemon(live):
    """A client of the daemon, which runs without models before and afterwards."""
    with connect(live.socket, timeout_s=PATIENCE_S) as client:
        yield client
        client.model("")
        client.model("", shadow=True)


@contextmanager
def workbench(chromium, live, directory, *options, recording="monday-1"):
    """A workbench whose page knows the live machine, with the recording open; no script may have failed."""
    options = ("--models", str(directory), *options)
    with page_process(live.socket, directory / "recordings", *options) as (address, _):
        context = chromium.new_context(viewport={"width": 1366, "height": 900})
        tab, failures = context.new_page(), []
        tab.on("pageerror", lambda error: failures.append(str(error)))
        try:
            tab.goto(address)
            tab.goto(address.partition("?")[0] + "workbench")
            open_recording(tab, "tripod.model.yaml", recording)
            yield tab
            assert failures == []
        finally:
            context.close()


def add_by_mouse(tab, effect):
    tab.locator(f".effect[data-effect={effect}]").click()
    until(tab, "bench.trial")
    tab.locator("#add").click()
    # it is there when the diagnosis has said whether the rows support it
    tab.locator("#confirm").click(timeout=1e3 * PATIENCE_S)
    until(tab, f"bench.summary?.ledger.length === 1 && {SHOWN}")


def order(tab, name):
    """The first step; the command line that it amounts to."""
    tab.locator(f"#{name}").click()
    until(tab, "document.querySelector('#confirm-order')?.disabled === false")
    return tab.locator("#live-model .consequence code").inner_text()


def order_answer(tab):
    until(tab, "!['', '…'].includes(document.querySelector('#live-model .order-answer').textContent)")
    return tab.locator("#live-model .order-answer").inner_text()


def numbers(tab):
    """Of the three bars, µm per coordinate."""
    return [bar.inner_text() for bar in tab.locator(".error-bar .head b").all()]


@pytest.mark.sample
def test_an_effect_is_added_run_as_a_shadow_and_adopted_by_mouse(chromium, live, daemon, directory, tmp_path):
    model = directory / "tripod.model.yaml"
    with workbench(chromium, live, directory) as tab:
        until(tab, "document.getElementById('live-state').textContent.includes('tripod-cmm is connected')")
        assert tab.locator("#live-shadow").is_disabled(), "there is no model file yet"
        assert "Add an effect first" in tab.locator("#live-why").inner_text()
        before = tab.evaluate("bench.summary.rms")
        add_by_mouse(tab, "link_zero")
        now = tab.evaluate("bench.summary.rms")
        assert now < 0.2 * before
        until(tab, f"document.querySelector('.error-bar b').textContent === '{before:.2f} → {now:.2f} µm'")

        assert order(tab, "live-shadow") == f"compd model shadow {model} --daemon {live.socket}"
        tab.locator("#confirm-order").click()
        assert order_answer(tab) == "Arm the page first."
        refused = tab.evaluate(
            "(model) => fetch('orders/shadow', {method: 'POST', body: JSON.stringify({id: '', subject: model})})"
            ".then((answer) => answer.status)",
            str(model),
        )
        assert refused == 403
        assert "shadow" not in daemon.model()

        tab.locator("#arm").click()
        until(tab, "document.getElementById('arm').textContent === 'Disarm'")
        tab.locator("#confirm-order").click()
        assert order_answer(tab) == "Done: run as a shadow."
        assert daemon.model()["shadow"]["file"] == str(model)
        assert daemon.model()["applied"]["effects"] == []
        until(tab, "document.getElementById('live-models').textContent.includes('link zero, this model as it is')")
        # the number of the recording, live: what the shadow moves the tip by, per coordinate
        until(tab, "document.querySelectorAll('.error-bar small')[1].textContent.startsWith('x ')")
        beyond = float(numbers(tab)[1].split()[0])
        assert beyond == pytest.approx(before, rel=0.2)
        tab.locator("#live-model").screenshot(path=str(tmp_path / "shadow.png"))

        order(tab, "live-adopt")
        assert "The correction changes by" in tab.locator("#live-model .consequence").inner_text()
        tab.locator("#confirm-order").click()
        done = "Done: adopt the shadow's model."
        until(tab, f'document.querySelector("#live-model .order-answer").textContent === "{done}"')
        assert daemon.model()["applied"]["file"] == str(model)
        assert daemon.model()["applied"]["effects"] == ["link_zero"]
        until(tab, "document.getElementById('live-models').textContent.startsWith('Applied: tripod.model.yaml')")
        until(tab, f"Math.abs(parseFloat(document.querySelectorAll('.error-bar b')[2].textContent) - {beyond}) < 0.1")
        assert numbers(tab)[1] == "0.00 µm", "nothing is left for this model to take out"
        tab.locator("#live-model").screenshot(path=str(tmp_path / "adopted.png"))

        assert order(tab, "live-no-model") == f"compd model adopt --none --daemon {live.socket}"
        tab.locator("#confirm-order").click()
        until(tab, "document.querySelector('#live-model .order-answer').textContent === 'Done: run without effects.'")
        assert daemon.model()["applied"]["effects"] == []


def test_an_adoption_that_is_not_possible_yet_becomes_possible_as_soon_as_the_shadow_runs(
    chromium, live, daemon, directory
):
    with workbench(chromium, live, directory) as tab:
        add_by_mouse(tab, "link_zero")
        tab.locator("#live-adopt").click()
        until(tab, "document.querySelector('#confirm-order')?.disabled === true")
        daemon.model(str(directory / "tripod.model.yaml"), shadow=True)
        until(tab, "document.querySelector('#confirm-order').disabled === false")
        assert "The correction changes by" in tab.locator("#live-model .consequence").inner_text()


def test_a_shadow_whose_file_has_changed_since_is_said_to_be_as_it_was(chromium, live, daemon, directory):
    with workbench(chromium, live, directory) as tab:
        add_by_mouse(tab, "link_zero")
        daemon.model(str(directory / "tripod.model.yaml"), shadow=True)
        until(tab, "document.getElementById('live-models').textContent.includes('this model as it is')")
        tab.locator("#undo").click()
        until(tab, "document.getElementById('live-models').textContent.includes('its file has changed since')")


def test_who_may_look_only_sees_numbers_and_command_lines_and_gives_no_order(chromium, live, daemon, directory):
    with workbench(chromium, live, directory, "--read-only") as tab:
        until(tab, "document.getElementById('live-why').textContent !== ''")
        assert tab.locator("#arm").is_disabled()
        tab.locator("#live-no-model").click()
        until(tab, "document.querySelector('#confirm-order')")
        assert "compd model adopt --none" in tab.locator("#live-model .consequence code").inner_text()
        tab.locator("#confirm-order").click()
        assert order_answer(tab) == "This browser is read-only."


def test_a_recording_of_another_machine_is_offered_nothing(chromium, live, daemon, directory):
    hexapod = load_machine("hexapod")
    for file in (directory / "recordings").iterdir():
        file.unlink()
    columns = gauges(100, 1, links=6, joints=12)
    record(directory / "recordings", columns, name="hexapod-1", machine="hexapod", configuration=hexapod)
    with workbench(chromium, live, directory, recording="hexapod-1") as tab:
        until(tab, "document.getElementById('live-models').textContent.startsWith('This recording is of hexapod')")
        assert not tab.locator("#live-shadow").is_visible()
        assert not tab.locator("#live-bars").is_visible()


def test_without_a_daemon_it_says_so_and_offers_nothing(chromium, directory):
    with workbench(chromium, LivePage("", 0, directory, directory, None), directory) as tab:
        until(tab, "document.getElementById('live-state').textContent.includes('no daemon answers')")
        assert not tab.locator("#arm").is_visible()
