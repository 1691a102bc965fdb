"""The machine's own log in the join wizard: read, named and joined with the mouse, as the command line joins it."""

from __future__ import annotations

import shlex

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from compd.recording import read_recording
from tests.support.command import run_in_process
from tests.support.live_page import page_process, until
from tests.support.log_files import BOOK, GERMAN, LEGS, POINTS, ROWS, TABBED, write_log_files

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    directory = tmp_path_factory.mktemp("log")
    write_log_files(directory, directory / "recordings" / "exports")
    return directory / "recordings"


@pytest.fixture(scope="module")
def address(recordings):
    with page_process(recordings.parent / "6-ups.yaml", recordings) as (address, _):
        yield address


@pytest.fixture
def tab(chromium, address):
    context = chromium.new_context(viewport={"width": 1200, "height": 900})
    failures = []
    tab = context.new_page()
    tab.on("pageerror", lambda error: failures.append(str(error)))
    tab.goto(address)
    tab.goto(address.partition("?")[0] + "join")
    until(tab, "wizard.sources && document.getElementById('log').options.length >= 2")
    yield tab
    context.close()
    assert failures == []


def choose(tab, log):
    tab.locator("#log").select_option(log)
    until(tab, f"wizard.log && wizard.choices.log === '{log}'")
    tab.locator("#export").select_option(POINTS)
    until(tab, "wizard.table")


def say(tab, control, value, command):
    tab.locator(control).select_option(value)
    until(tab, f"wizard.command.includes({command!r})")


def joined(tab, recordings, name):
    """Put together by order and written; what the equivalent command writes, which must be the same, byte by byte."""
    say(tab, "#choice-by", "order", "--by order")
    tab.locator("#try").click()
    until(tab, "wizard.trial")
    assert tab.evaluate("wizard.trial.reason") == ""
    tab.locator("#name").fill(name)
    until(tab, f"wizard.command.includes('/{name}.csv')")
    tab.locator("#write").click()
    tab.wait_for_selector("#open:visible")
    paths = [recordings / f"{name}{ending}" for ending in (".csv", ".yaml", "-machine.csv", "-machine.yaml")]
    by_mouse = [path.read_bytes() for path in paths]
    for path in paths:
        path.unlink()
    run_in_process(*shlex.split(tab.locator("#command code").inner_text())[1:])
    assert [path.read_bytes() for path in paths] == by_mouse
    return read_recording(paths[0])


@pytest.mark.sample
def test_a_workbook_is_read_with_its_dates(tab, recordings):
    choose(tab, BOOK)
    assert "no column is one of a recording" in tab.locator("#log-problems").inner_text()
    for i in LEGS:
        say(tab, f"#log-role-{i + 1}", f"scale_{i}_mm", f"Leg {i} [m]=scale_{i}_mm")
    say(tab, "#log-role-1", "time_s", "Time=time_s")
    say(tab, "#log-role-0", "point", "Nr=point")
    assert "row" in tab.locator("#log-note").inner_text()
    assert "2026-11-28" in tab.locator("#log-taken").inner_text()
    recording = joined(tab, recordings, "book")
    assert np.diff(recording.time_s) == pytest.approx(20.0, abs=1e-6)
    assert recording.rows == ROWS
    assert "machine_file: " in (recordings / "book.yaml").read_text()


def test_decimal_commas_and_angles_are_asked_about_and_converted(tab, recordings):
    choose(tab, GERMAN)
    for k, axis in enumerate("xyz"):
        say(tab, f"#log-role-{k + 1}", f"commanded_{axis}_mm", f"=commanded_{axis}_mm")
        say(tab, f"#log-role-{k + 4}", f"commanded_r{axis}_rad", f"=commanded_r{axis}_rad")
    assert "has no unit" in tab.locator("#log-problems").inner_text()
    for k, axis in enumerate("xyz"):
        say(tab, f"#log-unit-{k + 4}", "deg", f"=commanded_r{axis}_rad:deg")
    assert "in which order its angles turn is not said" in tab.locator("#log-problems").inner_text()
    assert tab.locator("#try").is_disabled()
    say(tab, "#choice-log_angles", "xyz", "--log-angles xyz")
    assert tab.locator("#log-problems").inner_text() == ""
    assert "in the order xyz" in tab.locator("#log-taken").inner_text()
    recording = joined(tab, recordings, "german")
    lines = (recordings / "exports" / GERMAN).read_text().splitlines()[1:]
    angles = np.array([[float(cell.replace(",", ".")) for cell in line.split(";")[4:]] for line in lines])
    vectors = np.stack([recording.columns[f"commanded_r{axis}_rad"] for axis in "xyz"], axis=1)
    assert vectors == pytest.approx(Rotation.from_euler("xyz", angles, degrees=True).as_rotvec(), abs=1e-9)


def test_a_text_below_other_lines_is_brought_and_read(tab, recordings, tmp_path):
    own = tmp_path / "my log.txt"
    own.write_bytes((recordings / "exports" / TABBED).read_bytes())
    tab.locator("#log-file").set_input_files(own)
    until(tab, "wizard.choices.log === 'my-log.txt.export' && wizard.log")
    assert "above the table" in tab.locator("#log-taken").inner_text()
    tab.locator("#export").select_option(POINTS)
    until(tab, "wizard.table")
    for i in LEGS:
        say(tab, f"#log-role-{i + 1}", f"scale_{i}_mm", f"=scale_{i}_mm")
    # a role that is taken from its column is nobody's then
    say(tab, "#log-role-2", "scale_2_mm", "Leg 1 [mm]=scale_2_mm")
    assert tab.locator("#log-role-3").input_value() == "-"
    say(tab, "#log-role-3", "scale_2_mm", "Leg 2 [mm]=scale_2_mm")
    say(tab, "#log-role-2", "scale_1_mm", "Leg 1 [mm]=scale_1_mm")
    assert joined(tab, recordings, "tabbed").rows == ROWS


def test_a_recording_takes_the_place_of_the_log(tab):
    choose(tab, TABBED)
    tab.locator("#log").select_option("")
    until(tab, "!wizard.choices.log && !wizard.log")
    assert tab.locator("#log-reading").is_hidden()
    assert tab.locator("#try").is_disabled()


def test_every_control_of_the_log_has_a_name_and_fits_a_narrow_window(tab):
    choose(tab, GERMAN)
    say(tab, "#log-role-4", "commanded_rx_rad", "=commanded_rx_rad")
    tab.set_viewport_size({"width": 900, "height": 700})
    assert tab.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    unnamed = """[...document.querySelectorAll('select, input, button')]
        .filter((control) => !control.labels?.length && !control.ariaLabel && !control.textContent.trim())
        .map((control) => control.outerHTML)"""
    assert tab.evaluate(unnamed) == []
