"""CONTRIBUTING.md: its worked examples, applied to a copy of the tree as they stand on the page, do what it says."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.walks import PAGE, Copy, Insertion, Walk, apply_all, inserted, walks

WALKS = walks()
# What iterates over all gauges, effects, causes, requests, commands, states, formats, criteria or scripts.
REGISTRIES = (
    "tests/unit/drivers/test_presets.py",
    "tests/unit/drivers/test_transcripts.py",
    "tests/unit/lines/test_line_kinds.py",
    "tests/unit/lines/test_simulated_lines.py",
    "tests/unit/library",
    "tests/unit/simulation/test_causes.py",
    "tests/unit/simulation/test_seeds.py",
    "tests/unit/live/test_client.py",
    "tests/unit/live/test_cycle.py",
    "tests/unit/live/test_daemon.py",
    "tests/unit/live/test_message_keys.py",
    "tests/unit/live/test_setpoint.py",
    "tests/unit/live/test_states.py",
    "tests/unit/cli/test_where_command.py",
    "tests/unit/docs/test_reference.py",
    "tests/unit/instruments",
    "tests/unit/diagnosis/test_criteria.py",
    "tests/unit/page/test_scripts.py",
    "tests/guard",
)

pytestmark = pytest.mark.skipif(not (ROOT / ".git").exists(), reason="the tree is copied by git")


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Copy:
    return Copy(tmp_path_factory.mktemp("contributing") / "compd")


@pytest.fixture
def copy(tree: Copy) -> Iterator[Copy]:
    """The tree as it was; compiled kernels are kept from test to test."""
    tree.restore()
    yield tree
    tree.restore()


def test_there_is_a_walk_for_everything_that_rooms_lists() -> None:
    rooms = (ROOT / "docs" / "explanation" / "rooms.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| an? .*\|$", rooms.partition("## What an addition touches")[2], flags=re.MULTILINE)
    assert len(listed) == len(WALKS) > 0


@pytest.mark.parametrize("walk", WALKS, ids=lambda walk: walk.title)
def test_every_block_has_its_place(walk: Walk) -> None:
    """Quick, so that whoever changes a line that a walk names hears of it at once."""
    assert {insertion.path for insertion in walk.insertions} == walk.files
    texts: dict[str, str] = {}
    for insertion in walk.insertions:
        path = ROOT / insertion.path
        before = texts.get(insertion.path) or (path.read_text(encoding="utf-8") if path.exists() else None)
        texts[insertion.path] = inserted(insertion, before)


@pytest.mark.parametrize(
    ("place", "line", "before", "mistake"),
    [
        ("before the line", "b", "a\n", "0 lines are 'b'"),
        ("after the line", "a", "a\na\n", "2 lines are 'a'"),
        ("a new file", "", "a\n", "there already"),
        ("at the end", "", None, "no such file"),
    ],
)
def test_a_block_without_its_place_is_a_mistake(place: str, line: str, before: str | None, mistake: str) -> None:
    with pytest.raises(AssertionError, match=mistake):
        inserted(Insertion("x.py", place, line, "new\n"), before)


def test_blocks_go_where_the_page_says() -> None:
    def placed(place: str, line: str = "") -> str:
        return inserted(Insertion("x.py", place, line, "new\n"), "a\n  b\nc\n")

    assert placed("before the line", "b") == "a\nnew\n  b\nc\n"
    assert placed("after the line", "b") == "a\n  b\nnew\nc\n"
    assert placed("in place of the line", "b") == "a\nnew\nc\n"
    assert placed("at the end") == "a\n  b\nc\n\n\nnew\n"


def test_links_and_targets_exist() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for link in re.findall(r"\]\((?!#)([^)]+)\)", text):
        assert (ROOT / link).exists(), link
    headings = re.findall(r"^## (.+)$", text, flags=re.MULTILINE)
    anchors = {heading.lower().replace(" ", "-") for heading in headings}
    assert set(re.findall(r"\]\(#([^)]+)\)", text)) <= anchors
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert set(re.findall(r"(?:^\$ |`)make ([\w-]+)", text, flags=re.MULTILINE)) <= set(targets)


@pytest.mark.long
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("walk", WALKS, ids=lambda walk: walk.title)
def test_a_walk_does_what_it_shows_and_touches_what_it_says(walk: Walk, copy: Copy) -> None:
    copy.apply(walk)
    assert copy.changed() == walk.files
    for console in walk.consoles:
        copy.show(console)
    assert copy.changed() == walk.files


@pytest.mark.long
@pytest.mark.sample
def test_all_walks_together_are_in_order_and_seen(copy: Copy) -> None:
    apply_all(copy, WALKS)
    for check in ("ruff check", "ruff format --check", "lint-imports"):
        copy.run(check)
    assert "xy_md02" in copy.run("compd gauge list")
    assert "frame_comparator_drift" in copy.run("compd model effects")
    assert " status " in copy.run("compd --help")
    assert "gsi (Leica GSI)" in " ".join(copy.run("COLUMNS=250 compd recording join --help").split())


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_all_walks_together_keep_types_docs_and_registries(copy: Copy) -> None:
    """The kernels of the copy are compiled anew."""
    apply_all(copy, WALKS)
    copy.run("mypy")
    copy.run("python -m docs.generate")
    assert "`out_of_reach`" in (copy.directory / "docs" / "reference" / "states.md").read_text(encoding="utf-8")
    copy.run(f"pytest -q {' '.join(REGISTRIES)}")


def test_the_walks_are_read_from_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = tmp_path / "CONTRIBUTING.md"
    page.write_text("## Add\n\nFiles: `a.py`.\n\nSome text\n\n```python\nx = 1\n```\n", encoding="utf-8")
    monkeypatch.setattr("tests.support.walks.PAGE", page)
    with pytest.raises(AssertionError, match=r"which file, and where\? 'Some text'"):
        walks()
