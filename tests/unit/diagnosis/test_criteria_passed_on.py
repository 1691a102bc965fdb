"""Whoever is given criteria hands them on: no call inside the packages falls back to the defaults."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

import compd

ROOT = Path(compd.__file__).parent
PACKAGES = ("comparison", "diagnosis", "fleet")
# Parameters that are criteria, or one number of them.
NAMES = {"criteria", "comparison", "spectrum", "huber", "blocks", "max_rows", "sign_flips"}


class Default(NamedTuple):
    """A parameter with a default.  place : among the positional ones; None where it takes a keyword."""

    name: str
    place: int | None


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def module_path(module: str) -> Path:
    return (ROOT.parent / module.replace(".", "/")).with_suffix(".py")


def of_arguments(arguments: ast.arguments, bound: int) -> Iterator[Default]:
    """bound : 1 of a method, which is called without its first argument.

    A default of None takes the criteria from elsewhere: those of the recording.
    """
    positional = [*arguments.posonlyargs, *arguments.args]
    first = len(positional) - len(arguments.defaults)
    for place, argument in enumerate(positional):
        if place >= first and argument.arg in NAMES and not is_none(arguments.defaults[place - first]):
            yield Default(argument.arg, place - bound)
    for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
        if default is not None and argument.arg in NAMES and not is_none(default):
            yield Default(argument.arg, None)


def is_none(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


@cache
def defaults(path: Path) -> dict[str, tuple[Default, ...]]:
    """Parameters with a default of each function and class of a module."""
    found: dict[str, tuple[Default, ...]] = {}
    for node in tree(path).body:
        if isinstance(node, ast.FunctionDef):
            found[node.name] = tuple(of_arguments(node.args, 0))
        if isinstance(node, ast.ClassDef) and "criteria" not in node.name.lower():
            fields = [part for part in node.body if isinstance(part, ast.AnnAssign)]
            names = [part.target.id for part in fields if isinstance(part.target, ast.Name) and part.value is not None]
            found[node.name] = tuple(Default(name, None) for name in names if name in NAMES)
            for part in node.body:
                if isinstance(part, ast.FunctionDef) and part.name == "__init__":
                    found[node.name] += tuple(of_arguments(part.args, 1))
    return found


def called(path: Path) -> dict[str, tuple[Default, ...]]:
    """By the name under which a module calls it."""
    named = dict(defaults(path))
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("compd."):
            source = module_path(node.module or "")
            if source.exists():
                known = defaults(source)
                named |= {alias.asname or alias.name: known.get(alias.name, ()) for alias in node.names}
    return named


def left_out(path: Path) -> list[str]:
    """Calls that leave a default to decide, with their lines."""
    named = called(path)
    found = []
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            given = {keyword.arg for keyword in node.keywords}
            for parameter in named.get(node.func.id, ()):
                by_place = parameter.place is not None and len(node.args) > parameter.place
                if parameter.name not in given and not by_place:
                    found.append(f"{path.name}:{node.lineno} {node.func.id}({parameter.name})")
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_no_call_leaves_criteria_to_their_defaults(package: str) -> None:
    paths = sorted((ROOT / package).rglob("*.py"))
    assert [call for path in paths for call in left_out(path)] == []


def test_a_call_that_leaves_them_is_found(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(
        "from compd.comparison.neighbour_block import neighbour_blocks as cut\n"
        "cut(recording)\n"
        "cut(recording, 3)\n"
        "cut(recording, blocks=3)\n",
        encoding="utf-8",
    )
    assert left_out(path) == ["module.py:2 cut(blocks)"]
