"""Who may do what: each line of the page names a test that is there, and each limit is the one in the code."""

from __future__ import annotations

import ast
import re
from functools import cache
from importlib import import_module
from typing import Any

import pytest

from tests.support.paths import ROOT

PAGE = (ROOT / "docs" / "explanation" / "security.md").read_text(encoding="utf-8")
TEST = re.compile(r"`(tests/[\w/]+\.py)::(\w+)`")
LIMIT = re.compile(r"`([\w.-]+):([\w.]+)`")
UNPROTECTED = "not tested"


def rows() -> list[list[str]]:
    """The cells of every line of a table, without headers."""
    lines = re.findall(r"(?m)^\|(.*)\|$", PAGE)
    cells = [[cell.strip() for cell in line.split("|")] for line in lines]
    separators = [i for i, line in enumerate(cells) if not set("".join(line)) - set("-:")]
    without = {*separators, *(i - 1 for i in separators)}
    return [line for i, line in enumerate(cells) if i not in without]


@cache
def functions_in(path: str) -> frozenset[str]:
    """The names of the tests in a file, without importing it."""
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    functions = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))
    return frozenset(node.name for node in functions)


ROWS = {f"{number}: {cells[0]}": cells for number, cells in enumerate(rows(), start=1)}
LIMITS = {name: cells for name, cells in ROWS.items() if len(cells) == 4 and LIMIT.search(cells[2])}


def test_the_page_has_its_tables() -> None:
    assert len(ROWS) > 40
    assert len(LIMITS) > 10


@pytest.mark.parametrize("cells", ROWS.values(), ids=ROWS)
def test_each_line_names_a_test_that_is_there(cells: list[str]) -> None:
    if cells[-1] == UNPROTECTED:
        assert cells[0] == "root"
        return
    named = TEST.findall(cells[-1])
    assert named, "this line names no test"
    for path, name in named:
        assert (ROOT / path).is_file(), path
        assert name in functions_in(path), f"{path} has no {name}"


@pytest.mark.parametrize("cells", LIMITS.values(), ids=LIMITS)
def test_each_limit_is_the_one_in_the_code(cells: list[str]) -> None:
    match = LIMIT.search(cells[2])
    assert match is not None
    assert str(value(*match.groups())) == cells[1]


def value(place: str, name: str) -> Any:
    """Of a constant of a module or of a unit's setting."""
    if place.endswith(".service"):
        settings = re.findall(rf"(?m)^{name}=(.*)$", (ROOT / "systemd" / place).read_text(encoding="utf-8"))
        assert len(settings) == 1
        return settings[0]
    found: Any = import_module(place)
    for part in name.split("."):
        found = getattr(found, part)
    return found
