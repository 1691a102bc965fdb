"""The picture of the page in README and docs is a screenshot of the page as it is now.

`COMPD_PICTURE=1 pytest tests/system/page/test_picture.py` makes it anew; otherwise it must be of these very files.
"""

from __future__ import annotations

import hashlib
import os
import re
from contextlib import contextmanager
from pathlib import Path

import pytest

from compd.page.server import STATIC
from tests.support.command import run_in_process
from tests.support.join_files import GAUGES, TRACK, write_join_files
from tests.support.live_page import opened, page_process, served, until
from tests.support.paths import CONFIG, ROOT
from tests.support.simulated import run_directory

PICTURE = ROOT / "docs" / "pictures" / "live-page.png"
ORDERS = PICTURE.with_name("live-page-orders.png")
WORKBENCH = PICTURE.with_name("workbench.png")
WIZARD = PICTURE.with_name("join-wizard.png")
# What the picture was made of, beside it.
MADE_OF = PICTURE.with_suffix(".made-of.txt")
# The machine warms up for so long before the picture, s; its weather is 60 times faster than real.
SHOWN_AFTER_S = 70.0


def page_files() -> str:
    """Hash of all that the browser gets."""
    digest = hashlib.sha256()
    for path in sorted(path for path in STATIC.rglob("*") if path.is_file()):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def photograph_workbench(chromium):
    """The workbench as in the tutorial, an effect tried but not kept."""
    with run_directory() as directory:
        recordings = directory / "recordings"
        recordings.mkdir()
        config = str(CONFIG / "tripod-cmm.yaml")
        run_in_process("sim", "campaign", config, "--hidden", "8", "--out", str(recordings / "monday.csv"))
        with view(chromium, directory, recordings, "workbench?recording=monday") as tab:
            until(tab, "document.querySelectorAll('.effect').length > 5")
            tab.locator(".effect").first.click()
            until(tab, "bench.trial")
            slider = tab.locator("#card input[type=range]").first
            tab.locator("#fit").click()
            slider.evaluate("(input) => { input.value *= 0.6; input.dispatchEvent(new Event('input')); }")
            tab.screenshot(path=str(WORKBENCH))


def photograph_wizard(chromium):
    """The join wizard with a tracker's export that is tried."""
    with run_directory() as directory:
        recordings = directory / "recordings"
        write_join_files(directory, recordings)
        with view(chromium, directory, recordings, "join") as tab:
            until(tab, "wizard.sources && document.getElementById('recording').options.length >= 2")
            tab.locator("#recording").select_option(GAUGES)
            tab.locator("#export").select_option(TRACK)
            until(tab, f"wizard.table && wizard.choices.export === '{TRACK}'")
            tab.locator("#try").click()
            until(tab, "wizard.trial && !wizard.trial.reason")
            tab.locator("#name").fill("monday")
            until(tab, "wizard.command.includes('/monday.csv')")
            tab.evaluate("scrollTo(0, 0)")
            tab.set_viewport_size({"width": 1440, "height": 1660})
            tab.screenshot(path=str(WIZARD))


@contextmanager
def view(chromium, models, recordings, address):
    """A view of a page without a daemon."""
    with page_process(Path("/no/socket"), recordings, "--models", str(models)) as (first, _):
        tab = chromium.new_context(viewport={"width": 1440, "height": 960}).new_page()
        tab.goto(first)
        tab.goto(first.partition("?")[0] + address)
        yield tab


def test_the_picture_is_of_the_page_as_it_is(chromium):
    if os.environ.get("COMPD_PICTURE"):
        with (
            served(simulate=("--speedup", "60", "--zero-hold", "20")) as page,
            opened(chromium, page, viewport={"width": 1440, "height": 960}) as tab,
        ):
            tab.wait_for_timeout(1e3 * SHOWN_AFTER_S)
            until(tab, "document.getElementById('state').textContent === 'OK'")
            tab.screenshot(path=str(PICTURE))
            tab.keyboard.press("o")
            tab.locator("#order-zero").click()
            tab.wait_for_selector("#confirm")
            tab.screenshot(path=str(ORDERS))
        photograph_workbench(chromium)
        photograph_wizard(chromium)
        MADE_OF.write_text(page_files() + "\n", encoding="utf-8")
    assert MADE_OF.read_text(encoding="utf-8").strip() == page_files(), (
        "the page has changed: COMPD_PICTURE=1 pytest tests/system/page/test_picture.py"
    )
    for picture in (PICTURE, ORDERS, WORKBENCH, WIZARD):
        width, height = (int.from_bytes(picture.read_bytes()[place : place + 4], "big") for place in (16, 20))
        assert width == 1440
        assert height == 960 or picture is WIZARD  # the whole of it


@pytest.mark.parametrize(
    ("page", "picture"),
    [
        ("README.md", PICTURE),
        ("docs/how-to/look-at-the-machine-live.md", PICTURE),
        ("README.md", WORKBENCH),
        ("docs/tutorials/with-the-mouse.md", WORKBENCH),
        ("docs/how-to/join-an-instrument.md", WIZARD),
    ],
)
def test_the_picture_is_shown(page, picture):
    shown = rf"!\[[^\]]+\]\([^)]*{re.escape(picture.name)}\)"
    assert re.search(shown, (ROOT / page).read_text(encoding="utf-8"))
