"""Orders of a model that is chosen from the list, and the command lines to copy."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.client import connect
from tests.support.live_models import file_with
from tests.support.live_page import LivePage, opened, page_process, until

pytestmark = pytest.mark.long


@pytest.fixture
def with_models(chromium, live, tmp_path):
    """A second page of the same daemon, which offers the model files of a directory."""
    for name, um in (("one.model.yaml", 10.0), ("two.model.yaml", 20.0)):
        file_with(tmp_path / name, "link_zero", link_zero=um)
    with page_process(Path(live.socket), tmp_path / "recordings", "--models", str(tmp_path)) as (address, pid):
        page = LivePage(address, pid, tmp_path, tmp_path / "recordings", live.machine)
        with opened(chromium, page, permissions=["clipboard-read", "clipboard-write"]) as tab:
            yield tab
    with connect(live.socket, 30.0) as daemon:
        daemon.model("")
        daemon.model("", shadow=True)


def confirmed(tab, order, done):
    tab.locator(f"#order-{order}").click()
    until(tab, "document.querySelector('#confirm') && !document.querySelector('#confirm').disabled")
    command = tab.locator(".consequence code").inner_text()
    tab.locator("#confirm").click()
    until(tab, f"document.querySelector('.order-answer').textContent === 'Done: {done}.'")
    return command


@pytest.mark.sample
def test_a_model_is_chosen_tried_adopted_and_left(with_models, live, tmp_path):
    tab = with_models
    tab.keyboard.press("o")
    tab.locator("#arm").click()
    until(tab, "document.getElementById('role').classList.contains('armed')")
    tab.locator(".choose button", has_text="two.model.yaml").click()
    assert tab.locator(".choose button[aria-pressed=true]").inner_text() == "two.model.yaml"
    command = confirmed(tab, "shadow", "run as a shadow")
    assert command == f"compd model shadow {tmp_path}/two.model.yaml --daemon {live.socket}"
    until(tab, "document.querySelectorAll('#budget .bar .shadow').length === 3")
    until(tab, "document.querySelector('.choose').innerText.includes('● shadow')")

    tab.locator(".choose button", has_text="one.model.yaml").click()
    tab.locator("#order-adopt").click()
    until(tab, "document.querySelector('.consequence')?.textContent.includes('two.model.yaml runs as a shadow')")
    assert tab.locator("#confirm").is_disabled(), "the shadow's numbers are not this model's"

    tab.locator(".choose button", has_text="one.model.yaml").click()  # and nothing is chosen: the shadow's
    command = confirmed(tab, "adopt", "adopt the shadow\\'s model")
    assert command == f"compd model adopt {tmp_path}/two.model.yaml --daemon {live.socket}"
    until(tab, "Math.abs(Math.abs(compd.live.setpoint.sources_mm?.link_zero?.[0]) - 0.02) < 1e-6")
    until(tab, "compd.slow.status.model.applied.effects[0] === 'link_zero'")
    confirmed(tab, "no-shadow", "end the shadow")
    confirmed(tab, "no-model", "run without effects")
    until(tab, "compd.live.setpoint.sources_mm && !compd.live.setpoint.sources_mm.link_zero")


@pytest.mark.sample
def test_a_name_that_is_not_in_the_list_is_refused_and_so_is_a_path(with_models, tmp_path):
    tab = with_models
    tab.keyboard.press("o")
    tab.locator("#arm").click()
    until(tab, "document.getElementById('role').classList.contains('armed')")
    for name in ("../two.model.yaml", "/etc/hostname", str(tmp_path / "two.model.yaml")):
        tab.locator("input[aria-label^='Model file']").fill(name)
        tab.locator("#order-shadow").click()
        until(tab, "document.querySelector('#confirm')?.disabled")
        assert "not a model file" in tab.locator(".consequence").inner_text()
        answer = tab.evaluate(
            "(subject) => fetch('orders/shadow', {method: 'POST', body: JSON.stringify({id: compd.id, subject})})"
            ".then((response) => response.status)",
            name,
        )
        assert answer == 409


def test_an_answer_that_comes_after_another_question_is_not_shown(with_models):
    """The page asks again whether an order that was not possible is so now, and an answer may come late."""
    tab = with_models
    tab.keyboard.press("o")
    name = tab.locator("input[aria-label^='Model file']")
    name.fill("../two.model.yaml")
    tab.locator("#order-shadow").click()
    until(tab, "document.querySelector('#confirm')?.disabled")
    late = []

    def hold(route):
        late.append(route)

    tab.route("**/orders/shadow?subject=*two*", hold)
    while not late:
        tab.wait_for_timeout(50.0)
    name.fill("one.model.yaml")
    tab.locator("#order-shadow").click()
    until(tab, "document.querySelector('#confirm')?.disabled === false")
    with tab.expect_response("**/orders/shadow?subject=*two*"):
        late[0].continue_()
    # the page has had its turn once an answer that was asked for later is read
    tab.evaluate("fetch('orders/shadow?subject=').then((response) => response.json())")
    assert "not a model file" not in tab.locator(".consequence").inner_text()
    assert tab.locator("#confirm").is_enabled()


def test_the_command_lines_of_orders_and_recordings_are_copied(with_models, live, tmp_path):
    tab = with_models
    tab.keyboard.press("o")
    tab.locator("#order-zero").click()
    tab.locator(".consequence .command button").click()
    until(tab, "document.querySelector('.consequence .command button').textContent === 'Copied'")
    assert tab.evaluate("navigator.clipboard.readText()") == f"compd zero --daemon {live.socket}"
    tab.locator("input[aria-label='Name of the recording']").fill("monday")
    lines = [code.inner_text() for code in tab.locator("#drawer > .command code").all()]
    record = f"compd recording start {tmp_path}/recordings/monday --daemon {live.socket}"
    assert lines == [record, f"{record} --burst 5"]


def test_a_download_has_its_command_line(with_models, tmp_path):
    tab = with_models
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "a-0001.csv").write_text("x\n", encoding="utf-8")
    tab.keyboard.press("o")
    until(tab, "document.querySelectorAll('#drawer td .command').length === 1")
    assert tab.locator("#drawer td .command code").inner_text() == f"cp {tmp_path}/recordings/a-0001.* ."
