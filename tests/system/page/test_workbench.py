"""The workbench in a real browser: a hidden effect is found, tried, added and taken back with the mouse alone."""

from __future__ import annotations

import json

import pytest

from compd.api import add_effect
from compd.model_file import read_stored
from compd.recording import read_sidecar
from tests.support.live_page import until
from tests.support.measured import gauges, hidden, record
from tests.support.workbench_page import SHOWN, page_without_machine, workbench_tabs

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    directory = tmp_path_factory.mktemp("workbench")
    (directory / "recordings").mkdir()
    hidden_effects = [hidden("link_expansion", 4.0), hidden("link_elasticity", 60.0)]
    record(directory / "recordings", gauges(600, 1), hidden_effects, name="monday-1")
    record(directory / "recordings", gauges(600, 2), hidden_effects, name="tuesday-1", seed=2)
    return directory


@pytest.fixture(scope="module")
def address(directory):
    with page_without_machine(directory) as (address, _):
        yield address


@pytest.fixture
def open_tab(chromium, address):
    """Opens a tab with this model file."""
    with workbench_tabs(chromium, address) as opened:
        yield opened


def big(tab, name):
    return tab.evaluate(f"bench.{name}")


def add_first(tab):
    """Choose the effect on top, fit it, see what adding it would do, and add it."""
    steps = big(tab, "summary?.ledger.length")
    tab.locator(".effect").first.click()
    until(tab, "bench.trial")
    tab.locator("#fit").click()
    tried = big(tab, "tried_rms")
    tab.locator("#add").click()
    tab.wait_for_selector("#confirm")
    tab.locator("#confirm").click()
    until(tab, f"bench.summary?.ledger.length === {steps + 1} && {SHOWN}")
    return tried


@pytest.mark.sample
def test_two_hidden_effects_are_found_and_added_by_mouse_with_the_ledger_of_the_commands(open_tab, directory):
    tab = open_tab("by-mouse.model.yaml")
    before = big(tab, "summary.rms")
    tried = add_first(tab)
    after_one = big(tab, "summary.rms")
    assert tried == pytest.approx(after_one, rel=0.02), "what was tried is what adding it brings"
    add_first(tab)
    until(tab, "bench.summary?.at_floor")
    assert big(tab, "summary.rms") < after_one < before
    by_mouse = read_stored(directory / "by-mouse.model.yaml")
    recording = directory / "recordings" / "monday-1.csv"
    by_command = add_effect(add_effect(None, by_mouse.steps[0].effect, recording), by_mouse.steps[1].effect, recording)
    assert {step.effect for step in by_mouse.steps} == {"link_expansion", "link_elasticity"}
    for mouse, command in zip(by_mouse.steps, by_command.steps, strict=True):
        assert (mouse.kind, mouse.effect) == (command.kind, command.effect)
        assert (mouse.rms_before_um, mouse.rms_after_um) == (command.rms_before_um, command.rms_after_um)
    assert by_mouse.state == by_command.state()


def test_the_residual_follows_the_slider_and_zero_is_where_it_was(open_tab):
    tab = open_tab("slider.model.yaml")
    tab.locator(".effect[data-effect=link_expansion]").click()
    until(tab, "bench.trial")
    slider = tab.locator("#card input[type=range]").first
    values = []
    for theta in (0.0, 1.0, 2.0, 3.0, 4.0):
        slider.evaluate("(input, theta) => { input.value = theta; input.dispatchEvent(new Event('input')); }", theta)
        values.append(big(tab, "tried_rms"))
    assert values[0] == pytest.approx(big(tab, "summary.rms"), rel=1e-4)
    assert values == sorted(values, reverse=True)
    assert "4 ppm/K" in tab.locator("#card output").first.inner_text()


def test_a_step_is_taken_back_and_keys_do_what_the_mouse_does(open_tab, directory):
    tab = open_tab("keys.model.yaml")
    before = big(tab, "summary.rms")
    tab.locator("#picture").focus()
    tab.keyboard.press("j")
    until(tab, "bench.trial")
    tab.keyboard.press("0")
    assert big(tab, "tried_rms") < before
    tab.locator("#add").click()
    tab.wait_for_selector("#confirm")
    tab.locator("#confirm").click()
    until(tab, f"bench.summary?.ledger.length === 1 && {SHOWN}")
    tab.locator("#picture").focus()
    tab.keyboard.press("u")
    until(tab, f"bench.summary?.ledger.length === 2 && {SHOWN}")
    assert big(tab, "summary.rms") == pytest.approx(before)
    assert [step.kind for step in read_stored(directory / "keys.model.yaml").steps] == ["add", "undo"]


def test_of_two_browsers_the_second_is_told(open_tab):
    first, second = open_tab("two.model.yaml"), open_tab("two.model.yaml")
    add_first(first)
    second.locator(".effect[data-effect=link_sag]").click()
    until(second, "bench.trial")
    second.locator("#add").click()
    second.wait_for_selector("#confirm")
    second.locator("#confirm").click()
    until(second, "document.getElementById('problem-line').textContent.includes('changed elsewhere')")
    assert big(second, "summary?.ledger.length") == 0


def lasso(tab, corners):
    """Draw around a part of the picture; corners: shares of its width and height."""
    box = tab.locator("#picture").bounding_box()
    places = [(box["x"] + across * box["width"], box["y"] + down * box["height"]) for across, down in corners]
    tab.mouse.move(*places[0])
    tab.mouse.down()
    for place in (*places[1:], places[0]):
        tab.mouse.move(*place, steps=4)
    tab.mouse.up()


def test_rows_are_chosen_in_one_picture_and_left_out_with_a_reason(open_tab, directory):
    tab = open_tab("rows.model.yaml")
    tab.locator("[role=tab]", has_text="time").click()
    used = big(tab, "summary.used")
    lasso(tab, [(0.0, 0.0), (0.15, 0.0), (0.15, 1.0), (0.0, 1.0)])
    until(tab, "bench.selection.rows.size > 0")
    chosen = tab.evaluate("[...bench.selection.rows]")
    assert max(chosen) < 120, "what is early in time is early in the file"
    tab.locator("[role=tab]", has_text="3D").click()
    assert big(tab, "selection.rows.size") == len(chosen), "the same rows in every picture"
    assert tab.locator("#exclude").is_disabled(), "a reason is needed"
    tab.locator("#chosen input").fill("it's cold")
    assert "--reason 'it'\\''s cold'" in tab.locator("#chosen code").inner_text()
    tab.locator("#exclude").click()
    until(tab, f"bench.summary?.used === {used - len(chosen)} && {SHOWN}")
    sidecar = read_sidecar(directory / "recordings" / "monday-1.yaml", [])
    assert set(sidecar.excluded) == set(chosen)
    assert set(sidecar.excluded.values()) == {"it's cold"}
    tab.locator(".include").click()
    until(tab, f"bench.summary?.used === {used} && {SHOWN}")
    assert read_sidecar(directory / "recordings" / "monday-1.yaml", []).excluded == {}


def test_rows_are_chosen_by_keyboard(open_tab):
    tab = open_tab("row-keys.model.yaml")
    tab.locator("#picture").focus()
    tab.keyboard.press("ArrowRight")
    tab.keyboard.press("Shift+ArrowRight")
    assert sorted(tab.evaluate("[...bench.selection.rows]")) == [2, 3]
    tab.keyboard.press("e")
    tab.keyboard.type("keys e d u 0 are text here")
    assert tab.locator("#chosen input").input_value() == "keys e d u 0 are text here"
    tab.locator("#picture").focus()
    tab.keyboard.press("Escape")
    assert big(tab, "selection.rows.size") == 0


@pytest.mark.sample
def test_every_picture_is_drawn_and_turns_with_what_is_tried(open_tab):
    tab = open_tab("pictures.model.yaml")
    tab.locator(".effect[data-effect=link_expansion]").click()
    until(tab, "bench.trial")
    pictures = tab.locator("[role=tab]").all_inner_texts()
    assert pictures == ["3D", "map xy", "map xz", "map yz", "target", "time"]
    for name in pictures:
        tab.locator("[role=tab]", has_text=name).click()
        before = tab.locator("#picture").screenshot()
        tab.keyboard.press("0")
        with_it = tab.locator("#picture").screenshot()
        tab.keyboard.press("x")
        assert tab.locator("#picture").screenshot() != with_it != before
        tab.keyboard.press("x")
        assert tab.locator("#picture").screenshot() == with_it
        tab.evaluate("bench.tried(null)")
    tab.locator("#against").select_option("temperature_room_degC")
    assert tab.evaluate("bench.picture.views[bench.picture.kind].title") == "temperature room, °C"


def test_the_row_under_the_pointer_shows_its_values(open_tab):
    tab = open_tab("values.model.yaml")
    tab.locator("[role=tab]", has_text="map xy").click()
    # the middle of the picture is in view
    tab.locator("#picture").scroll_into_view_if_needed()
    box = tab.locator("#picture").bounding_box()
    left, top = tab.evaluate("[...bench.picture.marks.slice(0, 2)]")
    tab.mouse.move(box["x"] + left, box["y"] + top)
    values = tab.locator(".row-values")
    values.wait_for()
    nearest = int(values.inner_text().split(",")[0].removeprefix("row "))
    row = tab.evaluate(f"[...bench.rows.row].indexOf({nearest})")
    residual = tab.evaluate(f"bench.rows.residual[{3 * row}]")
    assert f"residual x {residual:.2f} µm" in values.inner_text()
    assert "time since the first row, s: " in values.inner_text()
    tab.mouse.move(box["x"] + 2, box["y"] + 2)
    values.wait_for(state="hidden")


def test_the_machine_stands_around_the_arrows_until_it_is_switched_off(open_tab):
    tab = open_tab("around.model.yaml")
    parts = tab.evaluate("bench.rows.machine.map(({ part }) => part)")
    assert parts.count("rod") == 3
    near = tab.evaluate("bench.picture.views['3D'].project.px_per_mm")
    tab.get_by_role("checkbox", name="machine").uncheck()
    assert tab.evaluate("bench.picture.views['3D'].project.px_per_mm") > near


def test_constants_that_are_searched_have_a_slider(open_tab):
    tab = open_tab("constants.model.yaml")
    tab.locator(".effect[data-effect=link_expansion_lag]").click()
    until(tab, "bench.trial")
    tab.keyboard.press("0")
    fitted = big(tab, "tried_rms")
    slider = tab.locator("#card [data-constants]")
    first = big(tab, "trial.constants")
    slider.focus()
    tab.keyboard.press("End" if slider.input_value() == "0" else "Home")
    until(tab, f"JSON.stringify(bench.trial.constants) !== {json.dumps(json.dumps(first, separators=(',', ':')))}")
    assert big(tab, "tried_rms") != fitted


def test_an_effect_is_removed_again_as_by_command(open_tab, directory):
    tab = open_tab("removed.model.yaml")
    before = big(tab, "summary.rms")
    add_first(tab)
    tab.get_by_text("Remove link expansion …").click()
    tab.wait_for_selector("#confirm")
    tab.locator("#confirm").click()
    until(tab, f"bench.summary?.ledger.length === 2 && {SHOWN}")
    assert big(tab, "summary.rms") == pytest.approx(before)
    assert [step.kind for step in read_stored(directory / "removed.model.yaml").steps] == ["add", "remove"]
