"""Packages of extras: a command that needs one that is not installed says what to type."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions

import pytest

from compd.extras import EXTRAS, missing_package
from tests.support.paths import CONFIG, ROOT

# Runs compd as it is where the packages of these extras are not installed.
_WITHOUT = """
import sys
from compd.extras import EXTRAS

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {package for extra in EXTRAS for package in EXTRAS[extra]}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())
from compd.cli import main
main()
"""


def without_extras(*arguments: str, exit_code: int = 0) -> tuple[str, str]:
    """What `compd` prints on both outputs where no package of any extra is installed."""
    done = subprocess.run([sys.executable, "-c", _WITHOUT, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == exit_code, done.stderr
    return done.stdout, done.stderr


def test_the_extras_are_those_of_the_project_with_their_packages() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    declared = {
        extra: {line.partition(">=")[0] for line in lines if not line.startswith("compd[")}
        for extra, lines in project["optional-dependencies"].items()
        if extra != "dev"
    }
    distributions = packages_distributions()
    assert {extra: {distributions[name][0] for name in names} for extra, names in EXTRAS.items()} == declared


@pytest.mark.parametrize(
    ("arguments", "where", "package", "extra"),
    [
        (["page", "--daemon", "config/tripod-cmm.yaml"], "compd page", "", "page"),
        (["demo", "--live"], "compd demo", "", "page"),
        (["fleet", "report", "x"], "compd fleet", "distributed", "fleet"),
        (["compare", "x.csv", "--html", "x.html"], "compd compare", "plotly", "report"),
        (["diagnose", "x.csv", "--html", "x.html"], "compd diagnose", "plotly", "report"),
    ],
)
def test_a_command_that_needs_an_extra_says_what_to_type(
    arguments: list[str], where: str, package: str, extra: str
) -> None:
    said = without_extras(*arguments, exit_code=2)[1]
    assert f"{where}: needs the package {package}" in said
    assert f"next: pip install 'compd[{extra}]'" in said
    assert said.endswith("1 problem\n")


@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_numbers_on_a_terminal_need_no_extra(command: str) -> None:
    recording = ROOT / "tests" / "guard" / "files-0.2" / "campaign.csv"
    assert "noise" in without_extras(command, str(recording), "--machine", str(CONFIG / "tripod-cmm.yaml"))[0]


def test_a_mistake_in_an_import_is_no_missing_extra() -> None:
    assert (
        missing_package("compd page", ModuleNotFoundError("No module named 'compd.nowhere'", name="compd.nowhere"))
        is None
    )
