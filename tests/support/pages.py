"""The pages of the documentation as tests: every command, file and piece of Python on a page is run, in its order."""

from __future__ import annotations

import os
from pathlib import Path

import yaml
from sybil import Document, Example, Region, Sybil
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser
from sybil.parsers.myst.lexers import DirectiveLexer
from sybil.typing import Parser

from tests.support.paths import ROOT
from tests.support.simulated import run_directory
from tests.support.terminal import Terminal

# Fences that are run or read, and those that are shown only: nothing in these may be a command.
RUN = {"console", "python", "yaml"}
SHOWN = {"text", "json", "c", "ini"}
# Pages whose commands install into the system.
INSTALLS = {"docs/how-to/run-under-systemd.md"}
# Written by a program, or run by a test of their own.
GENERATED = ("docs/reference/", "docs/_build/", "docs/gallery/")


def run_console(example: Example) -> None:
    example.namespace["terminal"].run(example.parsed)


def read_yaml(example: Example) -> None:
    yaml.safe_load(example.parsed)


def write_file(example: Example) -> None:
    example.namespace["terminal"].write(*example.parsed)


def captioned_files(document: Document) -> list[Region]:
    """Code blocks with a caption: files that the reader writes."""
    regions = []
    for region in DirectiveLexer("code-block", ".+")(document):
        assert "caption" in region.lexemes["options"], f"{document.path}: a code-block without a caption"
        region.parsed = (region.lexemes["options"]["caption"].strip("`"), str(region.lexemes["source"]))
        region.evaluator = write_file
        regions.append(region)
    return regions


PARSERS: list[Parser] = [
    CodeBlockParser("console", run_console),
    CodeBlockParser("yaml", read_yaml),
    PythonCodeBlockParser(),
    captioned_files,
]
SYBIL = Sybil(PARSERS, pattern="*.md", path=str(ROOT))


def page_names() -> list[str]:
    """README and every page of docs/ that a person wrote."""
    names = [str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md")]
    return ["README.md", *sorted(name for name in names if not name.startswith(GENERATED))]


def run_page(name: str) -> None:
    """Run all of a page in a directory of its own."""
    document = SYBIL.parse(ROOT / name)
    with run_directory() as directory:
        before = Path.cwd()
        os.chdir(directory)
        terminal = document.namespace["terminal"] = Terminal(directory, name in INSTALLS)
        try:
            for example in document.examples():
                print(f"--- {name}, line {example.line}")
                example.evaluate()
        finally:
            os.chdir(before)
            terminal.close()


def fences(text: str) -> list[tuple[str, str]]:
    """(what stands behind the opening ```, content) of every fence."""
    blocks: list[tuple[str, str]] = []
    kind: str | None = None
    lines: list[str] = []
    for line in text.splitlines():
        if not line.startswith("```"):
            lines.append(line)
        elif kind is None:
            kind, lines = line[3:].strip(), []
        else:
            blocks.append((kind, "\n".join(lines)))
            kind = None
    return blocks
