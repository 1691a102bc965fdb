"""A diagnosis in a real browser: stages, verdict, evidence with buttons, its page; in every browser; and its end."""

from __future__ import annotations

import os
import signal
from contextlib import contextmanager

import pytest

from tests.support.live_page import until
from tests.support.measured import gauges, hidden, record
from tests.support.other_process import family, is_alive
from tests.support.patience import PATIENCE_S
from tests.support.workbench_page import open_recording, page_without_machine, workbench_tabs

pytestmark = pytest.mark.long

DONE = "document.querySelector('#diagnosis-outcome .word')"
RUNNING = "document.getElementById('diagnose').textContent.startsWith('Cancel')"
PANEL = "bench.panels.find((panel) => panel.constructor.name === 'Diagnosis')"


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    directory = tmp_path_factory.mktemp("diagnosis")
    (directory / "recordings").mkdir()
    # a long recording takes seconds, in which a person sees its stages, and cancels it
    effects = [hidden("link_expansion", 4.0), hidden("link_elasticity", 60.0)]
    record(directory / "recordings", gauges(900, 1), effects, name="monday-1")
    record(directory / "recordings", gauges(300, 3), effects[:1], name="tuesday-1")
    return directory


@pytest.fixture(scope="module")
def address(directory):
    with page_without_machine(directory) as (address, _):
        yield address


@pytest.fixture
def open_tab(chromium, address):
    """Opens a tab with this model file, of a browser of its own."""
    with workbench_tabs(chromium, address, apart=True, height=900) as opened:
        yield opened


def diagnosed(tab):
    tab.locator("#diagnose").click()
    until(tab, DONE)


def test_stages_then_the_verdict_then_the_evidence_and_its_buttons(open_tab, tmp_path):
    tab = open_tab("evidence.model.yaml")
    tab.locator("#diagnose").click()
    until(tab, f"{RUNNING} && document.querySelector('.stages .now')")
    assert tab.locator(".stages li").count() == 6
    until(tab, DONE)
    assert tab.locator(".word").inner_text().lower() == "identified"
    assert "What is missing is 2 effects" in tab.locator(".summary-lines .heading").inner_text()
    assert tab.locator(".summary-lines dt").count() <= 11
    assert tab.locator(".stages .now").count() == 0
    first = tab.locator("#diagnosis-outcome details").first
    text = first.inner_text()
    assert "ppm/K" in text
    assert "±" in text
    assert "plausible" in text
    assert "rows left out" in text
    assert "1 time in" in text
    assert tab.locator(".effect .remark", has_text="named, number").count() == 2
    tab.locator("[data-try=link_elasticity]").click()
    until(tab, "bench.trial && document.querySelector('#card h2').textContent === 'link elasticity'")
    tab.locator("[data-add=link_expansion]").click()
    tab.wait_for_selector(".proposal table")
    assert "link expansion" in tab.locator(".proposal", has=tab.locator("table")).inner_text()
    tab.screenshot(path=str(tmp_path / "diagnosis.png"), full_page=True)
    print(tmp_path / "diagnosis.png")


def test_rivals_and_formulas_are_handed_to_the_panels_that_plan_and_try(open_tab):
    tab = open_tab("rivals.model.yaml", "tuesday-1")
    tab.evaluate(
        f"""const panel = {PANEL};
        window.handed = [];
        panel.act.plan = (effects) => window.handed.push(effects);
        panel.act.formula = (formula) => window.handed.push(formula.id);
        const effect = {{effect: 'a', physics: '', equation: 'e', numbers: [], facts: [], separated_by: 's',
          rivals: [{{effect: 'b', alike: '99 %'}}], plan_command: 'compd plan'}};
        const lines = ['ambiguous: a or b', 'Or else:  b: these rows', '   cannot tell'];
        const evidence = {{verdict: 'ambiguous', lines,
          effects: [effect], follows: {{head: ['follows'], rows: [['time']], caption: ''}},
          formulas: [{{id: 'f', declaration: {{}}, text: '- id: f'}}], without_gain: []}};
        clearTimeout(panel.looking);
        panel.turn++;
        panel.show({{id: '1', state: 'done', seconds: 1, behind: 0, stages: [], steps: [], page: false, text: 't',
          result: {{steps: []}}, evidence}});"""
    )
    assert "b: these rows\ncannot tell" in tab.locator(".summary-lines").inner_text()
    assert "could as well be b (99 % alike" in tab.locator(".rivals").inner_text()
    tab.locator("[data-plan=a]").click()
    tab.locator("summary", has_text="What the rest follows").click()
    tab.locator("[data-formula=f]").click()
    assert tab.evaluate("window.handed") == [["a", "b"], "f"]


def test_it_is_cancelled_and_seen_in_another_browser_and_after_a_reload(open_tab):
    first, second = open_tab("two.model.yaml"), open_tab("two.model.yaml")
    first.locator("#diagnose").click()
    until(first, RUNNING)
    second.evaluate(f"{PANEL}.look()")  # at rest a browser looks too seldom for a diagnosis of seconds
    until(second, f"{RUNNING} && document.querySelectorAll('.stages .been, .stages .now').length >= 1")
    second.locator("#diagnose").click()
    for tab in (first, second):
        until(tab, "document.getElementById('diagnosis-state').textContent.startsWith('cancelled')")
    diagnosed(first)
    until(second, DONE)
    first.reload()
    open_recording(first, "two.model.yaml")
    until(first, DONE)
    assert first.locator("#diagnosis-outcome").inner_text() == second.locator("#diagnosis-outcome").inner_text()


def test_of_a_model_that_has_changed_since_it_says_so(open_tab):
    tab = open_tab("older.model.yaml", "tuesday-1")
    diagnosed(tab)
    assert tab.locator("#diagnosis-behind").inner_text() == ""
    tab.locator("[data-add=link_expansion]").click()
    tab.locator("#confirm").click()
    until(tab, "document.getElementById('diagnosis-behind').textContent.includes('model before the last step')")
    assert tab.locator(".word").count() == 1, "what it has found stays"
    assert tab.locator(".effect .remark", has_text="named").count() == 0


def test_its_page_works_in_a_sandbox_of_its_own(open_tab):
    tab = open_tab("page.model.yaml", "tuesday-1")
    diagnosed(tab)
    until(tab, "document.querySelector('#diagnosis-page a')")
    with tab.context.expect_page() as opening:
        tab.locator("#diagnosis-page a").click()
    page = opening.value
    failures = []
    page.on("console", lambda message: failures.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: failures.append(str(error)))
    page.reload()
    page.wait_for_selector(".plotly svg")
    assert page.evaluate("window.origin") == "null"
    refused = "fetch('/recordings').then(() => 'answered', () => 'refused')"
    assert failures == []
    assert page.evaluate(refused) == "refused"


@contextmanager
def diagnosing(directory, chromium):
    """A page whose server runs a diagnosis; the server's process, and those that it started."""
    with page_without_machine(directory) as (address, pid):
        context = chromium.new_context()
        try:
            tab = context.new_page()
            tab.goto(address)
            tab.goto(address.partition("?")[0] + "workbench")
            open_recording(tab, "end.model.yaml")
            tab.locator("#diagnose").click()
            until(tab, "document.querySelector('.stages .now')")
            children = family(pid) - {pid}
            assert len(children) > 1, "what workers are forked from, and a worker"
            yield tab, pid, children
        finally:
            context.close()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_it_ends_with_the_server_however_that_ends(directory, chromium, number):
    with diagnosing(directory, chromium) as (tab, pid, children):
        os.kill(pid, number)
        for _ in range(round(PATIENCE_S / 0.05)):
            if not any(map(is_alive, children)):
                break
            tab.wait_for_timeout(50)
        assert not any(map(is_alive, children))
