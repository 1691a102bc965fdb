"""An effect of one's own in a real browser: typed with a mistake, mended, tried, kept, added as the command adds it."""

from __future__ import annotations

import re

import pytest
from typer.testing import CliRunner

from compd.cli.app import app
from tests.support.live_page import until
from tests.support.measured import gauges, hidden, record
from tests.support.workbench_page import SHOWN, page_without_machine, workbench_tabs

pytestmark = pytest.mark.long

GROWTH = "k * link_mm * (temperature_link - 20) / 1000"


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    directory = tmp_path_factory.mktemp("formula")
    (directory / "recordings").mkdir()
    record(directory / "recordings", gauges(600, 1), [hidden("link_expansion", 4.0)], name="monday-1")
    return directory


@pytest.fixture(scope="module")
def address(directory):
    with page_without_machine(directory) as (address, _):
        yield address


@pytest.fixture
def open_tab(chromium, address):
    """Opens a tab with this model file, and waits for the form as well."""
    with workbench_tabs(chromium, address) as opened:

        def with_form(model):
            tab = opened(model)
            until(tab, "document.getElementById('formula-text')")
            return tab

        yield with_form


def problem(field):
    """What stands under a field."""
    return f"document.getElementById(document.querySelector('{field}').getAttribute('aria-describedby')).textContent"


def fill_in_growth(tab):
    """The formula and its parameter, for which a row is there as soon as the formula names it."""
    tab.locator("#formula-id").fill("growth")
    tab.locator("#formula-text").fill(GROWTH)
    tab.wait_for_selector(".parameter")
    for label, value in (("unit", "ppm/K"), ("plausible from", "0"), ("to", "23"), ("where that range", "steel 12")):
        tab.locator(".parameter .field", has_text=re.compile(f"^{label}")).locator("input").fill(value)
    until(tab, "bench.trial && bench.tried_rms")


def test_a_mistake_stands_under_the_formula_and_when_it_is_mended_the_residual_moves(open_tab):
    tab = open_tab("mistake.model.yaml")
    tab.locator("#formula-text").fill("k * link_mm * (temperature_link - 20")
    until(tab, f"{problem('#formula-text')}.includes('is not a formula')")
    assert tab.locator("#formula .problem mark").inner_text() == "("
    assert tab.evaluate("bench.tried_rms") is None
    fill_in_growth(tab)
    assert tab.evaluate(problem("#formula-text")) == ""
    rms, floor = tab.evaluate("bench.summary.rms"), tab.evaluate("bench.summary.floor")
    assert tab.evaluate("bench.tried_rms") < 1.2 * floor < 0.5 * rms
    assert tab.locator("#card h2").inner_text() == "growth"
    assert tab.locator(".effect", has_text="being written").count() == 1
    slider = tab.locator("#card input[type=range]")
    slider.evaluate("(input) => { input.value = 0; input.dispatchEvent(new Event('input')); }")
    assert tab.evaluate("bench.tried_rms") == pytest.approx(rms, rel=1e-4)


def test_a_column_is_named_by_a_click_and_one_that_is_not_measured_is_told(open_tab):
    tab = open_tab("names.model.yaml")
    tab.locator("#formula-text").fill("k * ")
    tab.locator("#columns button", has_text="humidity_pct").click()
    assert tab.locator("#formula-text").input_value() == "k * humidity_pct"
    tab.locator("#formula-text").fill("k * humdity_pct")
    until(tab, f"{problem('#formula-text')}.includes('did you mean humidity_pct?')")
    tab.locator("#formula-id").fill("Not a name")
    until(tab, f"{problem('#formula-id')}.includes('is no name')")
    tab.locator("#formula-id").fill("link_expansion")
    until(tab, f"{problem('#formula-id')} === ''")


def test_it_is_kept_there_after_opening_anew_and_added_as_the_command_adds_it(open_tab, directory):
    tab = open_tab("kept.model.yaml")
    file = directory / "own.effects.yaml"
    file.write_text("# what I suspect\n- id: other\n  port: link  # a guess\n  formula: k * humidity_pct\n"
                    "  parameters: {k: {unit: um/pct, plausible: [0, 1], source: notes}}\n")  # fmt: skip
    fill_in_growth(tab)
    tab.locator("#save-effect").click()
    until(tab, "document.querySelectorAll('.own').length === 2")
    assert f"--effects {file}" in tab.evaluate("bench.summary.commands.diagnose")
    assert file.read_text().startswith("# what I suspect\n- id: other\n  port: link  # a guess\n")
    second = open_tab("kept.model.yaml")
    second.locator(".effect[data-effect=growth]").click()
    until(second, "bench.trial")
    command = second.locator("#card .command code").inner_text()
    assert command.startswith(f"compd model add {file}:growth --recording")
    second.locator("#add").click()
    second.wait_for_selector("#confirm")
    second.locator("#confirm").click()
    until(second, f"bench.summary?.ledger.length === 1 && {SHOWN}")
    words = command.replace("kept.model", "command.model").split()[1:]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    undated = [
        re.sub(r"\d{4}-\d\d-\d\d[T\d:+Z.-]*|checksum: .*", "", (directory / name).read_text())
        for name in ("kept.model.yaml", "command.model.yaml")
    ]
    assert undated[0] == undated[1]


def test_it_is_replaced_and_deleted_only_after_a_question(open_tab, directory):
    file = directory / "own.effects.yaml"
    file.unlink(missing_ok=True)
    tab = open_tab("replaced.model.yaml")
    fill_in_growth(tab)
    tab.locator("#save-effect").click()
    until(tab, "document.getElementById('saved-effects').options.length === 2")
    tab.locator(".parameter .field", has_text="where that range").locator("input").fill("drawing")
    tab.locator("#save-effect").click()
    tab.wait_for_selector("#confirm-own")
    assert "steel 12" in file.read_text()
    with tab.expect_response("**/own"):
        tab.locator("#confirm-own").click()
    until(tab, f"{SHOWN} && document.querySelector('.effect[data-effect=growth]')")
    assert file.read_text().count("id: growth") == 1
    assert "drawing" in file.read_text()
    tab.locator("#delete-effect").click()
    tab.locator("#confirm-own").click()
    until(tab, f"{SHOWN} && document.getElementById('saved-effects').options.length === 1")
    assert not file.exists()
