"""`import compd`: which names it offers, that it is quick, and that each name's documentation is true."""

from __future__ import annotations

import doctest
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import compd
from compd.errors import CompdError
from docs.generate.python import ORDER
from tests.support.paths import ROOT

HEAVY = ("numba", "plotly", "pandas", "numpy", "scipy", "pydantic")


def test_import_compd_imports_nothing_heavy() -> None:
    code = f"import sys, compd; dir(compd); print([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_one_name_imports_its_own_module_only() -> None:
    code = "import sys, compd; compd.CompdError; print([name for name in ('numba', 'plotly') if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", ORDER)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(compd, name)
    assert value.__name__ == name
    assert name in dir(compd)
    text = inspect.getdoc(value) or ""
    if inspect.isfunction(value):
        for heading in ("Parameters", "Returns", "Examples"):
            assert f"{heading}\n{'-' * len(heading)}" in text
        documented = text.split("Returns\n-------")[0]
        for parameter in inspect.signature(value).parameters:
            assert f"\n{parameter} : " in documented
    else:
        assert "Attributes\n----------" in text


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="attribute compere"):
        compd.compere  # noqa: B018


def test_the_reference_page_has_every_name() -> None:
    assert sorted([*ORDER, "__version__"]) == sorted(compd.__all__)


def test_the_version_is_the_installed_one() -> None:
    assert compd.__version__.count(".") == 2


@pytest.mark.long
@pytest.mark.sample
def test_the_examples_of_the_docstrings_are_true(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the order of the reference page, in one directory, as a reader would type them."""
    monkeypatch.chdir(tmp_path)
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    tried, said = 0, ""
    for name in ORDER:
        test = parser.get_doctest(getattr(compd, name).__doc__ or "", {}, name, None, None)
        said += "".join(_run(runner, test))
        tried += len(test.examples)
    assert said == ""
    assert tried > 20
    assert (tmp_path / "next.csv").exists()


def _run(runner: doctest.DocTestRunner, test: doctest.DocTest) -> list[str]:
    lines: list[str] = []
    runner.run(test, out=lines.append)
    return lines


@pytest.mark.parametrize("kind", [str, Path])
def test_a_machine_is_a_name_a_path_or_loaded(kind: type, tmp_path: Path) -> None:
    by_name = compd.load_machine("tripod-cmm")
    by_path = compd.load_machine(kind(ROOT / "config" / "tripod-cmm.yaml"))
    assert by_name.config_hash == by_path.config_hash
    assert compd.load_machine(by_name) is by_name


def test_a_machine_that_does_not_exist_is_refused_with_the_next_step(tmp_path: Path) -> None:
    with pytest.raises(CompdError) as error:
        compd.load_machine("tripod")
    (problem,) = error.value.problems
    assert problem.value == "tripod"
    assert "tripod-cmm" in problem.allowed
    assert "path" in problem.next_step
    with pytest.raises(CompdError, match=r"none\.yaml"):
        compd.load_machine(tmp_path / "none.yaml")
