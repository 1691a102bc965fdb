"""The template driver package: its own tests pass, its entry points resolve, and one file alone will do."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from compd.cli.live.gauge import driver as driver_cli
from compd.plugins import GAUGES, load, names
from tests.support.paths import ROOT

TEMPLATE = ROOT / "drivers" / "template"


@pytest.mark.long
@pytest.mark.sample
def test_its_own_tests_pass() -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "--rootdir",
            str(TEMPLATE),
            "-c",
            str(TEMPLATE / "pyproject.toml"),
            str(TEMPLATE / "tests"),
        ],
        env={"PYTHONPATH": str(TEMPLATE), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "passed" in done.stdout


def test_installed_it_is_found_and_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As pip installs it: the package and its entry points on the path."""
    project = tomllib.loads((TEMPLATE / "pyproject.toml").read_text())["project"]
    shutil.copytree(TEMPLATE / "my_gauge", tmp_path / "my_gauge")
    information = tmp_path / "compd_my_gauge-0.1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 0.1.0\n")
    groups = project["entry-points"]
    (information / "entry_points.txt").write_text(
        "".join(f"[{group}]\n" + "".join(f"{k} = {v}\n" for k, v in points.items()) for group, points in groups.items())
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert "my_gauge" in names(GAUGES)
    result = CliRunner().invoke(driver_cli.driver, ["my_gauge", "--quick"])
    assert result.exit_code == 0, result.output
    assert "nothing failed" in result.output
    for name in [module for module in sys.modules if module.startswith("my_gauge")]:
        del sys.modules[name]


def test_by_path_without_any_package(tmp_path: Path) -> None:
    for name in ("driver", "simulated"):
        shutil.copy(TEMPLATE / "my_gauge" / f"{name}.py", tmp_path / f"{name}.py")
        (tmp_path / f"{name}.py").chmod(0o644)
    arguments = [f"{tmp_path}/driver.py:MyGauge", "--simulator", f"{tmp_path}/simulated.py:SimulatedMyGauge"]
    result = CliRunner().invoke(driver_cli.driver, [*arguments, "--quick"])
    assert result.exit_code == 0, result.output


def test_the_guide_is_right() -> None:
    """Every gauge in the guides' YAML is one that its driver accepts, and what the guides name exists."""
    pages = ("add-a-gauge", "describe-a-gauge", "write-a-driver")
    guide = "\n".join((ROOT / "docs" / "how-to" / f"{page}.md").read_text() for page in pages)
    blocks = [yaml.safe_load(block) for block in re.findall(r"```yaml\n(.*?)```", guide, re.DOTALL)]
    gauges = {name: options for block in blocks for name, options in block.get("gauges", {}).items()}
    assert len(gauges) >= 3
    for name, options in gauges.items():
        driver = load(GAUGES, options["driver"], name)
        assert driver(driver.Options.model_validate(options)).channels
    for path in re.findall(r"`((?:drivers|docs|config)/[\w./-]+)`", guide):
        assert (ROOT / path).exists(), path
