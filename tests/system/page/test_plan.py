"""The next measurement planned in a real browser: the rows, the words and the files of `compd plan`."""

from __future__ import annotations

import csv
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from tests.support.live_page import until
from tests.support.measured import gauges, hidden, record
from tests.support.workbench_page import page_without_machine, workbench_tabs

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    directory = tmp_path_factory.mktemp("plan")
    (directory / "recordings").mkdir()
    record(directory / "recordings", gauges(600, 1), [hidden("link_elasticity", 60.0)], name="monday-1")
    return directory


@pytest.fixture(scope="module")
def address(directory):
    with page_without_machine(directory) as (address, _):
        yield address


@pytest.fixture
def tab(chromium, address):
    with workbench_tabs(chromium, address) as opened:
        tab = opened("machine.model.yaml")
        until(tab, "document.querySelectorAll('#plan .limits input').length === 10")
        yield tab


def choose(tab, *rivals):
    for k, name in enumerate(rivals):
        tab.locator(f"#plan select[aria-label^='Rivals, number {k + 1}']").select_option(name)


def test_the_rows_and_files_are_those_of_the_command(tab, directory, tmp_path):
    choose(tab, "link_elasticity", "joint_contact")
    tab.locator("#plan-rows").fill("12")
    tab.get_by_label("largest load, N").fill("100")
    tab.locator("#plan-button").click()
    until(tab, "document.querySelectorAll('#plan-table tbody tr').length > 0")
    assert "times the measurement's noise" in tab.locator("#plan-summary").inner_text()
    tab.locator("#plan-feed").fill("1200")
    for shape in ("sa", "csv", "gcode", "plan"):
        with tab.expect_download() as waiting:
            tab.locator(f"#plan [data-format={shape}]").click()
        words = shlex.split(tab.locator("#plan .command code").inner_text())[1:]
        words[-1] = str(tmp_path / shape)
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
        assert Path(waiting.value.path()).read_bytes() == (tmp_path / shape).read_bytes()
    with (tmp_path / "plan").open(newline="") as file:
        _, *rows = csv.reader(file)
    cells = "(row) => [...row.cells].map((cell) => cell.textContent)"
    shown = tab.evaluate(f"[...document.querySelectorAll('#plan-table tbody tr')].map({cells})")
    assert [[row[1], *map(float, (row[0], *row[2:]))] for row in shown] == [
        [row[1], *map(float, (row[0], *row[2:]))] for row in rows
    ]


def test_what_is_wrong_stands_under_its_field(tab):
    tab.locator("#plan-button").click()
    until(tab, "document.querySelector('#plan .problem')?.textContent.includes('two effects or more')")
    choose(tab, "link_elasticity", "joint_contact")
    tab.locator("#plan-rows").fill("1")
    tab.get_by_label("temperature, °C, from").fill("30")
    tab.get_by_label("largest load, N").fill("many")
    tab.locator("#plan-button").click()
    under = "document.getElementById(document.querySelector('#plan-rows').getAttribute('aria-describedby')).textContent"
    until(tab, f"{under}.includes('2 to 400')")
    assert tab.locator("#plan [aria-invalid]").count() == 2
    assert tab.locator("#plan-table").count() == 0


def chosen(tab, label):
    """The effects in the selects with this label."""
    return tab.eval_on_selector_all(f"#plan select[aria-label^='{label}']", "selects => selects.map((s) => s.value)")


def test_what_a_card_says_is_alike_is_planned_from_its_button(tab):
    tab.locator(".effect[data-effect=link_elasticity]").click()
    tab.get_by_role("button", name="Plan what tells them apart").click()
    rivals = chosen(tab, "Rivals")
    assert rivals[0] == "link_elasticity"
    assert "joint_contact" in rivals
    assert tab.evaluate("document.activeElement.id") == "plan-button"
    assert tab.locator("#plan .problem").all_inner_texts() == [""] * tab.locator("#plan .problem").count()


def test_what_a_diagnosis_cannot_tell_apart_is_suggested(tab):
    found = {
        "steps": [{"effect": "tool_bending", "rivals": []}, {"effect": "link_elasticity", "rivals": ["joint_contact"]}]
    }
    tab.evaluate("(found) => bench.panels.find((panel) => panel.suggestFor).suggestFor(found)", found)
    assert chosen(tab, "Rivals") == ["link_elasticity", "joint_contact"]
    assert chosen(tab, "Found as well") == ["tool_bending"]
    tab.locator("#plan-button").click()
    until(tab, "document.querySelectorAll('#plan-table tbody tr').length > 0")
    assert "--beside tool_bending" in tab.locator("#plan .command code").inner_text()
