"""A person who always adds the effect on top is warned before a wrong one, whatever is hidden.

The person knows the words on the page alone. What is hidden is in a sealed file that is opened at the end, to score.
"""

from __future__ import annotations

import json
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from compd.model.library import load_library
from compd.simulation import Mechanism, draw_hidden
from tests.support.command import run_in_process
from tests.support.naive_user import NaiveUser
from tests.support.paths import CONFIG
from tests.support.simulated import tripod
from tests.support.workbench_page import page_without_machine

pytestmark = pytest.mark.long

# The first number that is looked through; from here on nobody has looked at what they hide.
FIRST = 100
PLAIN_FLOORS = 2.5
LIBRARY, OUTSIDE = 8, 2
# Effects that a person adds before giving up.
MOST_ADDED = 4


def numbers() -> list[int]:
    """Two numbers that plainly hide what the library does not have, and eight of the library, each another cause."""
    mechanism, known = Mechanism(tripod()), load_library()
    hidden: dict[str, int] = {}
    for number in range(FIRST, FIRST + 300):
        cause = draw_hidden(number, mechanism)
        if cause.floors >= PLAIN_FLOORS:
            hidden.setdefault(cause.id, number)
    library = [number for name, number in hidden.items() if name in known]
    outside = [number for name, number in hidden.items() if name not in known]
    return [*islice(outside, OUTSIDE), *islice(library, LIBRARY)]


# `make sample` runs one of either kind: a cause that nothing explains, and one of the library.
SAMPLE = (0, OUTSIDE)
NUMBERS = [
    pytest.param(number, marks=[pytest.mark.sample] if k in SAMPLE else []) for k, number in enumerate(numbers())
]


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("hidden")
    (directory / "recordings").mkdir()
    return directory


@pytest.mark.parametrize("number", NUMBERS)
def test_who_always_adds_the_effect_on_top_is_warned_before_a_wrong_one(
    chromium: Any, directory: Path, number: int
) -> None:
    recording = directory / "recordings" / f"hidden-{number}.csv"
    run_in_process("sim", "campaign", str(CONFIG / "tripod-cmm.yaml"), "--hidden", str(number), "--out", str(recording))
    warned, unwarned = [], []
    with page_without_machine(directory) as (address, _):
        context = chromium.new_context(viewport={"width": 1366, "height": 768})
        try:
            tab = context.new_page()
            tab.goto(address)
            user = NaiveUser(tab)
            user.follow("Workbench")
            user.open(recording.stem, f"hidden-{number}.model.yaml")
            while not warned and len(unwarned) < MOST_ADDED:
                offered = user.propose_top()
                if offered.warning:
                    warned.append(offered)
                else:
                    unwarned.append(offered.effect.replace(" ", "_"))
                    user.confirm()
        finally:
            context.close()
    answers = json.loads(recording.with_suffix(".answer.json").read_text())["answers"]
    assert set(unwarned) <= set(answers), "a wrong effect was added without a warning"
    assert warned, "effects are offered without end"
    verdicts = ("adequate:", "ambiguous:", "partial:", "unexplained:", "not testable:", "likely:", "identified:")
    assert any(word in warned[0].warning for word in verdicts), warned[0].warning
