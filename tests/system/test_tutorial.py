"""README, "Learn which effect is missing": every command is run, and prints what the section says, numbers aside."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from compd.client import connect
from compd.demo.processes import Command, run_commands
from compd.demo.session import wait_for_gauges
from tests.support.paths import ROOT
from tests.support.simulated import run_directory

SECTION = "## Learn which effect is missing"
# What the section writes, and what it is while the test runs.
MACHINE = "/tmp/machine"
WIDTH = "100"
TIMEOUT_S = 200.0


class Shown(NamedTuple):
    """A command as the section shows it, whether it runs beside the others, and the lines that it prints."""

    words: list[str]
    beside: bool
    prints: list[str]


def commands() -> Iterator[Shown]:
    """Those of the section: indented lines that begin with `$ `, their output below them."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    section = text.partition(f"{SECTION}\n")[2].partition("\n## ")[0]
    for block in re.findall(r"(?:^ {4}.*\n(?:\n(?= {4}))?)+", section, re.MULTILINE):
        lines = [line[4:].rstrip() for line in block.splitlines() if line.strip()]
        starts = [number for number, line in enumerate(lines) if line.startswith("$ ")]
        for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
            words = shlex.split(lines[start][2:], comments=True)
            beside = words[-1] == "&"
            yield Shown(words[:-1] if beside else words, beside, lines[start + 1 : end])


def without_numbers(line: str) -> str:
    """The words of a line: numbers, and how wide they make a table, change from run to run."""
    line = re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", line)
    return " ".join(re.sub("([━─])+", r"\1", line).split())


def check_printed(shown: Shown, output: str) -> None:
    """Every line of the section is there, in its order; `...` stands for anything, alone for any lines."""
    printed = iter([without_numbers(line) for line in output.splitlines()])
    for line in shown.prints:
        wanted = re.compile(".*".join(map(re.escape, without_numbers(line).split("..."))))
        assert line == "..." or any(wanted.fullmatch(text) for text in printed), (
            f"{shown.words}: {line!r} is not in\n{output}"
        )


@contextmanager
def beside(words: list[str], directory: Path) -> Iterator[None]:
    process = subprocess.Popen([sys.executable, "-m", *words], cwd=directory, stdout=subprocess.DEVNULL)
    try:
        yield
        assert process.wait(TIMEOUT_S) == 0, words
    finally:
        process.kill()
        process.wait()


READY = {"simulate": "control.sock", "run": "compd.sock"}


def run_all(directory: Path) -> None:
    """One after the other; those beside the others until the end, or until they end themselves."""
    machine = directory / "machine"
    environment = {**os.environ, "COLUMNS": WIDTH}
    with ExitStack() as stack:
        for number, shown in enumerate(commands()):
            words = [word.replace(MACHINE, str(machine)) for word in shown.words]
            words = [str(ROOT / word) if word.startswith("config/") else word for word in words]
            if shown.beside and words[1] in READY:
                command = Command(words[1:], ready=machine / READY[words[1]])
                stack.enter_context(run_commands([command], directory / f"{number}.log"))
            elif shown.beside:
                stack.enter_context(beside(words, directory))
            else:
                if words[:2] == ["compd", "zero"]:
                    with connect(words[2]) as observer, connect(words[2]) as daemon:
                        wait_for_gauges(observer, daemon.watch(10.0))
                start = [sys.executable, "-m"] if words[0] == "compd" else []
                done = subprocess.run(
                    [*start, *words],
                    cwd=directory,
                    env=environment,
                    timeout=TIMEOUT_S,
                    capture_output=True,
                    text=True,
                    check=False,
                )
                print("$", *shown.words, *shown.beside * "&")
                print(done.stdout, end="")
                assert done.returncode == 0, f"{words}: {done.stderr}"
                check_printed(shown, done.stdout)


@pytest.mark.long
@pytest.mark.sample
@pytest.mark.timeout(600)
def test_every_command_of_the_section() -> None:
    with run_directory() as directory:
        run_all(directory)
