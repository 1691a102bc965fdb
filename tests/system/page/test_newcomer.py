"""A person who knows only the words on the page corrects a machine, and brings a lost gauge back.

Two files are there: the machine's own log, and the export of an instrument. Each control is found by its name or role.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from tests.support.command import run_in_process
from tests.support.instrument_files import split_campaign, write_export
from tests.support.live_page import page_process, running_machine
from tests.support.naive_user import NaiveUser
from tests.support.paths import CONFIG

pytestmark = pytest.mark.long

# Hides the growth of the links with temperature, which the running machine measures, too.
HIDDEN = 4
# Where the links are driven while a gauge is lost, mm from machine zero.
ELSEWHERE_MM = [0.3, 0.3, 0.3]


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    """The machine's log and the instrument's track, on another clock and in another frame."""
    campaign, log = tmp_path / "campaign.csv", tmp_path / "controller.csv"
    run_in_process("sim", "campaign", str(CONFIG / "tripod-cmm.yaml"), "--hidden", str(HIDDEN), "--out", str(campaign))
    track = split_campaign(campaign, log, keep=()).track()
    return log, write_export(tmp_path, "csv", track, stem="tracker")


def test_from_two_files_to_a_corrected_machine_and_a_gauge_that_is_believed_again(
    chromium: Any, files: tuple[Path, Path]
) -> None:
    log, export = files
    with (
        running_machine() as (directory, machine),
        page_process(directory / "tripod-cmm.yaml", directory / "recordings") as (address, _),
    ):
        context = chromium.new_context(viewport={"width": 1366, "height": 768})
        user = NaiveUser(context.new_page())
        try:
            user.tab.goto(address)
            join(user, log, export)
            correct(user)
            user.follow("Live")
            user.see(re.compile("^OK$"))
            machine.ask("FAULT", line="scale_2", fault="unplugged")
            user.see("check plug, cable and power")
            machine.ask("DRIVE", scale_mm=ELSEWHERE_MM)
            while machine.ask("TRUTH")["moving"]:
                user.tab.wait_for_timeout(20)
            machine.ask("FAULT", line="scale_2", fault=None)
            accept(user)
        finally:
            context.close()


def join(user: NaiveUser, log: Path, export: Path) -> None:
    """From the live page to the recording that is put together from both files."""
    user.follow("Workbench")
    user.follow("Join a measurement")
    user.see("Uploads are copied there")
    user.bring("Bring a log of the machine", log)
    user.see(re.compile(r"\d+ rows are read"))
    user.bring("or bring one", export)
    user.see(re.compile(r"column 2 'x_mm'"))
    user.write("Standard uncertainty, µm", "0.2")
    user.press("Try")
    user.see("rows have a reference now")
    user.write("Name", "monday")
    user.press("Write")
    user.follow("Open it in the workbench")
    user.wait_for_effects()


def correct(user: NaiveUser) -> None:
    """Learn which effect is missing, add it, see the error fall, and adopt it."""
    user.see("measured and modelled differ by")
    before_um = user.error_um()
    user.press("Diagnose")
    user.see("What is missing is link_expansion")
    user.press("Add …")
    user.confirm()
    assert user.error_um() < 0.3 * before_um
    user.see("Nothing is missing")
    user.press("Run this model as a shadow …")
    user.press("Arm for 60 s")
    user.press("Run as a shadow")
    user.see("Done: run as a shadow.")
    user.press("Adopt it …")
    user.press("Adopt the shadow's model")
    user.see("Done: adopt the shadow's model.")
    user.see("Applied: monday.model.yaml (link expansion")


def accept(user: NaiveUser) -> None:
    """Do what the banner says of a gauge that is not believed."""
    user.see("reference it, then accept it")
    user.press("Accept gauges …")
    user.press("Arm for 60 s")
    user.tab.get_by_role("button", name="Accept gauges", exact=True).click()
    user.see(re.compile("^Done: accept gauges"))
    user.see(re.compile("^OK$"))
