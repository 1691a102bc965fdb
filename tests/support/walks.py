"""The worked examples of CONTRIBUTING.md: read from the page, and applied to a copy of the tree.

A walk is a section with a line `Files: ...`. Above each of its blocks of code stands the file and the place:

    `FILE`, a new file:                 `FILE`, at the end:
    `FILE`, before the line `LINE`:     also `after the line` and `in place of the line`

LINE stands in the file exactly once, compared without the spaces round it. A console block is run; a block of any other
kind without a file above it is a mistake.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tests.support.paths import ROOT
from tests.support.terminal import EXIT_CODE, WIDTH, check_printed, shown_commands

PAGE = ROOT / "CONTRIBUTING.md"
TIMEOUT_S = 600
# A code span; one that holds a backtick is written with two.
CODE = r"(?:``(.+)``|`([^`]+)`)"
ABOVE = re.compile(rf"`([^`]+)`, (a new file|at the end|(?:before|after|in place of) the line)(?: {CODE})?:")


class Insertion(NamedTuple):
    """A block of code, and where it goes; `line`: the line that marks the place, "" where there is none."""

    path: str
    place: str
    line: str
    text: str


class Walk(NamedTuple):
    """One worked example; `files`: those that it says it touches; `consoles`: the console blocks."""

    title: str
    files: frozenset[str]
    insertions: tuple[Insertion, ...]
    consoles: tuple[str, ...]


def walks() -> list[Walk]:
    """Those of CONTRIBUTING.md, in order."""
    sections = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return [_walk(section) for section in sections if "\nFiles: " in section]


def _walk(section: str) -> Walk:
    title, _, body = section.partition("\n")
    (files,) = re.findall(r"^Files: (.+?)\.$", body, flags=re.MULTILINE | re.DOTALL)
    insertions, consoles = [], []
    for fence in re.finditer(r"^```(\w+)\n(.*?)^```$", body, flags=re.MULTILINE | re.DOTALL):
        kind, text = fence.groups()
        if kind == "console":
            consoles.append(text)
            continue
        above = body[: fence.start()].rstrip().rpartition("\n")[2]
        place = ABOVE.fullmatch(above)
        assert place, f"{title}: which file, and where? {above!r}"
        insertions.append(Insertion(place[1], place[2], (place[3] or place[4] or "").strip(), text))
    return Walk(title, frozenset(re.findall("`(.+?)`", files)), tuple(insertions), tuple(consoles))


def inserted(insertion: Insertion, before: str | None) -> str:
    """The file's text with the block in its place; `before`: its text now, None where there is no such file."""
    path, place, wanted, text = insertion
    if place == "a new file":
        assert before is None, f"{path} is there already"
        return text
    assert before is not None, f"{path}: no such file"
    if place == "at the end":
        return f"{before}\n\n{text}"
    lines = before.splitlines(keepends=True)
    at = [number for number, line in enumerate(lines) if line.strip() == wanted]
    assert len(at) == 1, f"{path}: {len(at)} lines are {wanted!r}"
    start = at[0] + (place == "after the line")
    end = at[0] + (place != "before the line")
    return "".join([*lines[:start], text, *lines[end:]])


class Copy:
    """A copy of the tree, with a git repository and caches of its own."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=True,
        )
        for name in filter(None, listed.stdout.split("\0")):
            if (ROOT / name).is_file():
                (directory / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, directory / name)
        # mypy trusts a cache whose files have the same contents
        if (ROOT / ".mypy_cache").is_dir():
            shutil.copytree(ROOT / ".mypy_cache", directory / ".mypy_cache")
        (directory / "build").mkdir()
        for command in ("init -q", "add -A", "-c user.name=test -c user.email=test@test commit -q --no-verify -m tree"):
            self.run(f"git {command}")

    def restore(self) -> None:
        """Back to what was copied; what git ignores, caches among it, is kept."""
        self.run("git checkout -q .")
        self.run("git clean -dfq")

    def apply(self, walk: Walk) -> None:
        """Write every block in its place; the formatter may put blank lines right, and nothing else."""
        for insertion in walk.insertions:
            path = self.directory / insertion.path
            before = path.read_text(encoding="utf-8") if path.exists() else None
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(inserted(insertion, before), encoding="utf-8")
        written = {name: _without_blank_lines(self.directory / name) for name in walk.files if name.endswith(".py")}
        if written:
            self.run("ruff format -q " + " ".join(written))
        for name, lines in written.items():
            assert _without_blank_lines(self.directory / name) == lines, f"{name}: not as the formatter would have it"

    def changed(self) -> set[str]:
        """Files that differ from what was copied, and new ones, but for the pages that `docs.generate` writes."""
        return {line[3:] for line in self.run("git status --porcelain -uall -- . :^docs/reference").splitlines()}

    def show(self, console: str) -> None:
        """Run a console block, and compare what it prints with what it shows."""
        for shown in shown_commands(console):
            wanted = EXIT_CODE.search(shown.command)
            check_printed(shown, self.run(shown.command, int(wanted[1]) if wanted else 0))

    def run(self, command: str, exit_code: int = 0) -> str:
        """What a command prints, run in the copy with the copy's code."""
        environment = {
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": f"{self.directory}{os.pathsep}{self.directory / 'drivers'}",
            "COLUMNS": WIDTH,
            "NO_COLOR": "1",
        }
        # a test in the copy is a run of its own
        for name in ("PYTEST_CURRENT_TEST", "PYTEST_XDIST_WORKER", "PYTEST_ADDOPTS", "GIT_DIR", "GIT_INDEX_FILE"):
            environment.pop(name, None)
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=self.directory,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
        print(f"$ {command}\n{done.stdout}")
        assert done.returncode == exit_code, f"$ {command}\nexit code {done.returncode}\n{done.stdout[-6000:]}"
        return done.stdout


def apply_all(copy: Copy, chosen: Sequence[Walk]) -> None:
    """Several walks in one copy, one after the other."""
    for walk in chosen:
        copy.apply(walk)


def _without_blank_lines(path: Path) -> list[str]:
    return [line for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
