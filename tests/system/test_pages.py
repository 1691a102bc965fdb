"""README and the pages of docs/: everything on them runs, and nothing on them is a command that no test runs."""

from __future__ import annotations

import re

import pytest
from _pytest.mark import ParameterSet

from tests.support.mosquitto import needs_mosquitto
from tests.support.pages import RUN, SHOWN, fences, page_names, run_page
from tests.support.paths import ROOT

# tests/system/test_tutorial.py
TUTORIAL = "docs/tutorials/missing-effect.md"


# A machine that is simulated in real time has both processors for itself; other pages run side by side.
MACHINE = re.compile(r"^\$ (compd (sim run|run|demo|page)|make demo)\b", re.MULTILINE)
PAGES = [name for name in page_names() if name != TUTORIAL]
WITH_MACHINE = [name for name in PAGES if MACHINE.search((ROOT / name).read_text(encoding="utf-8"))]
# Pages that start a program which is not of this project.
NEEDS = {"docs/how-to/read-mqtt.md": needs_mosquitto}
# Pages that take two thirds of the time of all; .ci/run leaves them to `make nightly`.
LONGEST = {
    f"docs/how-to/{name}.md"
    for name in (
        "add-an-effect", "calibrate-a-machine", "change-the-running-model", "describe-a-gauge", "diagnose-a-telescope",
        "join-an-instrument", "look-at-the-processes", "measure-at-a-fixed-pin", "measure-with-a-ballbar",
        "other-controllers", "read-mqtt", "read-opc-ua", "record-and-replay", "tell-two-effects-apart",
        "watch-a-fleet", "write-a-driver",
    )
}  # fmt: skip


def marked(name: str) -> ParameterSet:
    sample = () if name in LONGEST else (pytest.mark.sample,)
    return pytest.param(name, marks=[*sample, *((NEEDS[name],) if name in NEEDS else ())])


@pytest.mark.long
@pytest.mark.parametrize("name", [marked(name) for name in WITH_MACHINE])
def test_everything_on_a_page_with_a_machine_runs(name: str) -> None:
    run_page(name)


def test_the_longest_pages_are_there() -> None:
    assert set(PAGES) >= LONGEST


@pytest.mark.long
@pytest.mark.parametrize("name", [marked(name) for name in PAGES if name not in WITH_MACHINE])
def test_everything_on_a_page_runs(name: str) -> None:
    run_page(name)


# A command, alone or in a block that is indented instead of fenced.
COMMAND = re.compile(r"^ *(\$ |compd |make |pip )", re.MULTILINE)


@pytest.mark.parametrize("name", page_names())
def test_every_fence_is_run_or_holds_no_command(name: str) -> None:
    text = (ROOT / name).read_text(encoding="utf-8")
    for kind, content in fences(text):
        if kind.startswith("{"):
            continue
        assert kind in RUN | SHOWN, f"{name}: a fence is {' or '.join(sorted(RUN | SHOWN))}, not {kind!r}"
        if kind in SHOWN:
            assert not COMMAND.search(content), f"{name}: not run:\n{content}"
    outside = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    indented = [line for line in outside.splitlines() if re.match(r" {4}(\$|compd|make|pip) ", line)]
    assert not indented, f"{name}: commands that no test runs: {indented}"
