"""The join wizard in a real browser: a measurement is joined with the mouse alone, as the command line joins it."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.support.command import run_in_process
from tests.support.join_files import GAUGES, GAUGES_WITH_PLACES, GERMAN_TRACK, POINTS, TRACK, write_join_files
from tests.support.live_page import page_process, until

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    directory = tmp_path_factory.mktemp("join")
    write_join_files(directory, directory / "recordings")
    return directory / "recordings"


@pytest.fixture(scope="module")
def address(recordings):
    with page_process(Path("/no/socket"), recordings) as (address, _):
        yield address


@pytest.fixture
def open_tab(chromium):
    """Opens the wizard at an address with its token; no script may fail, and nothing be refused but by words."""
    context = chromium.new_context(viewport={"width": 1200, "height": 900})
    failures = []

    def opened(address):
        tab = context.new_page()
        tab.on("pageerror", lambda error: failures.append(str(error)))
        tab.on("console", lambda message: failures.append(message.text) if message.type == "error" else None)
        tab.goto(address)
        tab.goto(address.partition("?")[0] + "join")
        until(tab, "wizard.sources && document.getElementById('recording').options.length >= 2")
        failures.clear()  # of the live page, which has no daemon here
        return tab

    yield opened
    context.close()
    assert [failure for failure in failures if "status of 4" not in failure] == []


@pytest.fixture
def tab(open_tab, address):
    return open_tab(address)


def choose(tab, recording, export):
    tab.locator("#recording").select_option(recording)
    tab.locator("#export").select_option(export)
    until(tab, f"wizard.table && wizard.choices.export === '{export}'")


def say(tab, key, value, command):
    """Choose, and wait until the command line has it."""
    control = tab.locator(f"#choice-{key}")
    if control.evaluate("control => control.tagName") == "SELECT":
        control.select_option(value)
    else:
        control.fill(value)
        control.blur()
    until(tab, f"wizard.command.includes('{command}')")


def roles(tab):
    return tab.eval_on_selector_all("#table select", "selects => selects.map((select) => select.value)")


def write(tab, name):
    """Try, then write; the command line that is shown."""
    tab.locator("#try").click()
    until(tab, "wizard.trial && !wizard.trial.reason")
    tab.locator("#name").fill(name)
    until(tab, f"wizard.command.includes('/{name}.csv')")
    tab.locator("#write").click()
    tab.wait_for_selector("#open:visible")
    assert tab.locator("#open").get_attribute("href") == f"/workbench?recording={name}"
    return tab.locator("#command code").inner_text()


def assert_command_writes_the_same(recordings, name, command):
    """Run the command line in place of the page; both files must be the same, byte by byte."""
    paths = [recordings / f"{name}{ending}" for ending in (".csv", ".yaml")]
    by_mouse = [path.read_bytes() for path in paths]
    for path in paths:
        path.unlink()
    run_in_process(*shlex.split(command)[1:])
    assert [path.read_bytes() for path in paths] == by_mouse


@pytest.mark.sample
def test_a_track_is_joined_by_mouse_as_by_the_command(tab, recordings):
    choose(tab, GAUGES, TRACK)
    assert roles(tab) == ["time", "x", "y", "z"]
    assert "by its name, mm" in tab.locator("#taken").inner_text()
    say(tab, "sigma_um", "0.5", "--sigma-um 0.5")
    assert tab.locator("#write").is_disabled(), "nothing is tried yet"
    command = write(tab, "by-time")
    assert "rows have a reference now" in tab.locator("#result").inner_text()
    assert "next best" in tab.locator("#picture-note").inner_text()
    assert_command_writes_the_same(recordings, "by-time", command)


def test_a_meaning_changed_by_click_is_read_again(tab, recordings):
    choose(tab, GAUGES, TRACK)
    tab.locator("#role-1").select_option("y")
    until(tab, "wizard.command.includes('--columns time,y,x,z')")
    assert roles(tab) == ["time", "y", "x", "z"]
    assert "as --columns says" in tab.locator("#taken").inner_text()
    # a column that is needed is missing: in words, with the table still there
    tab.locator("#role-0").select_option("-")
    until(tab, "wizard.table.roles[0] === '-'")
    assert "has no times" in tab.locator("#putting-note").inner_text()
    tab.locator("#role-0").select_option("rx")
    until(tab, "document.querySelector('.problem')")
    assert "an attitude is not whole" in tab.locator(".problem").inner_text()
    assert tab.locator("#try").is_disabled()
    assert len(roles(tab)) == 4
    tab.locator("#guess").click()
    until(tab, "!wizard.command.includes('--columns')")
    assert roles(tab) == ["time", "x", "y", "z"]
    tab.locator("#role-1").select_option("y")
    until(tab, "wizard.command.includes('--columns time,y,x,z')")
    # a mirrored frame goes with the motion as well: the offset is the same
    assert_command_writes_the_same(recordings, "exchanged", write(tab, "exchanged"))


def test_semicolons_and_decimal_commas_are_seen_and_said(tab, recordings):
    choose(tab, GAUGES, GERMAN_TRACK)
    taken = tab.locator("#taken").inner_text()
    assert "semicolon" in taken
    assert "detected: comma" in tab.locator("#choice-decimal").inner_text()
    say(tab, "decimal", ",", "--decimal ,")
    say(tab, "dates", "dmy", "--dates dmy")
    assert_command_writes_the_same(recordings, "german", write(tab, "german"))


@pytest.mark.sample
def test_points_at_rest_are_joined_by_order(tab, recordings):
    choose(tab, GAUGES_WITH_PLACES, POINTS)
    until(tab, "document.getElementById('putting-note').textContent.includes('--by order')")
    tab.locator("#try").click()
    until(tab, "wizard.trial?.reason")
    assert "has no times" in tab.locator("#result").inner_text()
    say(tab, "by", "order", "--by order")
    assert tab.locator("#choice-moving").is_hidden()
    command = write(tab, "by-order")
    assert "476 points at their dwells" in tab.locator("#picture-note").inner_text()
    assert_command_writes_the_same(recordings, "by-order", command)


def test_an_export_is_brought_from_this_computer(tab, recordings, tmp_path):
    own = tmp_path / "My points (2).csv"
    own.write_bytes((recordings / "exports" / POINTS).read_bytes())
    tab.locator("#file").set_input_files(own)
    until(tab, "wizard.choices.export === 'My-points-2.csv.export' && wizard.table")
    assert (recordings / "exports" / "My-points-2.csv.export").read_bytes() == own.read_bytes()
    own.write_text("something else 1 2 3\n")
    tab.locator("#file").set_input_files(own)
    until(tab, "document.getElementById('problem-line').textContent.includes('other content')")
    own.write_bytes(b"")
    tab.locator("#file").set_input_files(own)
    until(tab, "document.getElementById('problem-line').textContent.includes('is empty')")
    binary = tmp_path / "binary.dat"
    binary.write_bytes(bytes(range(256)) * 10)
    tab.locator("#file").set_input_files(binary)
    until(tab, "document.querySelector('.problem')?.textContent.includes('is not text')")
    tab.evaluate("wizard.sources.most_bytes = 100")
    tab.locator("#file").set_input_files(binary)
    until(tab, "document.getElementById('problem-line').textContent.includes('too large')")


def test_an_export_is_deleted_by_keyboard_after_one_question(tab, recordings, tmp_path):
    own = tmp_path / "old.csv"
    own.write_bytes((recordings / "exports" / POINTS).read_bytes())
    tab.locator("#file").set_input_files(own)
    until(tab, "wizard.choices.export === 'old.csv.export' && wizard.table")
    kept = recordings / "exports" / "old.csv.export"
    until(tab, "document.getElementById('usage-note').textContent.includes('of 200 files')")
    tab.locator("#delete").focus()
    tab.keyboard.press("Enter")
    assert "old.csv.export" in tab.locator("#deleting").inner_text()
    tab.keyboard.press("Escape")
    assert tab.locator("#deleting").is_hidden()
    assert tab.evaluate("document.activeElement.id") == "delete"
    assert kept.exists()
    tab.keyboard.press("Enter")
    tab.keyboard.press("Enter")
    until(tab, "document.getElementById('problem-line').textContent.includes('is deleted')")
    assert not kept.exists()
    assert tab.locator("#delete").is_disabled()
    assert "old.csv.export" not in tab.locator("#export").inner_text()
    log = (recordings.parent / "page.log").read_text()
    assert 'what="DELETE /join/exports/old.csv.export"' in log


def test_a_token_is_shown_in_the_form_without_a_script_and_the_page_is_left(chromium, address):
    context = chromium.new_context(java_script_enabled=False)
    tab = context.new_page()
    tab.goto(address.partition("?")[0])
    tab.get_by_label("Token").fill(address.partition("token=")[2])
    tab.keyboard.press("Enter")
    tab.wait_for_selector("#banner")
    assert tab.url == address.partition("?")[0]
    (cookie,) = context.cookies()
    assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")
    context.close()
    context = chromium.new_context()
    tab = context.new_page()
    tab.goto(address)
    tab.keyboard.press("o")
    tab.locator("#leave").click()
    tab.wait_for_selector("#token")
    assert context.cookies() == []
    context.close()


def test_the_server_refuses_what_is_too_large_without_keeping_it(tab, recordings):
    before = sorted(path.name for path in (recordings / "exports").iterdir())
    sent = """fetch('join/exports?name=large.txt', {method: 'POST', body: new Uint8Array(65 * 2 ** 20)})
        .then((response) => response.status, () => 'cut off')"""
    assert tab.evaluate(sent) in (409, "cut off")
    assert sorted(path.name for path in (recordings / "exports").iterdir()) == before


def test_every_control_has_a_name_and_fits_a_narrow_window(tab):
    choose(tab, GAUGES, TRACK)
    tab.set_viewport_size({"width": 900, "height": 700})
    assert tab.evaluate("document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    unnamed = """[...document.querySelectorAll('select, input, button')]
        .filter((control) => !control.labels?.length && !control.ariaLabel && !control.textContent.trim())
        .map((control) => control.outerHTML)"""
    assert tab.evaluate(unnamed) == []


def test_who_may_look_only_tries_and_cannot_write(open_tab, recordings):
    with page_process(Path("/no/socket"), recordings, "--read-only") as (address, _):
        tab = open_tab(address)
        choose(tab, GAUGES_WITH_PLACES, POINTS)
        say(tab, "by", "order", "--by order")
        tab.locator("#try").click()
        until(tab, "wizard.trial && !wizard.trial.reason")
        tab.locator("#name").fill("mine")
        until(tab, "wizard.command.includes('/mine.csv')")
        assert tab.locator("#write").is_disabled()
        assert tab.locator("#file").is_disabled()
        assert tab.locator("#delete").is_disabled()
        assert "read-only" in tab.locator("#writing-note").inner_text()
        asked = (
            "fetch('join/recording', {method: 'POST', body: JSON.stringify(wizard.choices)}).then(({status}) => status)"
        )
        assert tab.evaluate(asked) == 403
    assert not (recordings / "mine.csv").exists()
