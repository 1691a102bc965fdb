"""What a newcomer gives `compd calibrate` and `compd machine export` by mistake is told before the work, in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from compd.cli.app import app
from compd.errors import CompdError
from tests.support.built_machines import built, drawing, record


def command(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with a drawing and a recording of two poses."""
    directory = tmp_path_factory.mktemp("mistakes")
    machine = drawing("6-ups", directory)
    rng = np.random.default_rng(8)
    record(directory / "two.csv", built(machine, rng), rng, 2)
    return directory


def test_two_poses_are_refused(measured: Path) -> None:
    done = command("calibrate", measured / "two.csv", "--machine", measured / "6-ups.yaml", "--hold", "target")
    said = str(done.exception)
    assert isinstance(done.exception, CompdError)
    assert "has too few poses" in said
    assert "2 rows with a pose" in said
    assert "10 or more" in said


@pytest.mark.parametrize(
    "arguments",
    [
        ("calibrate", "two.csv", "--machine", "6-ups.yaml", "--out", "missing/as-built.yaml"),
        ("machine", "export", "6-ups.yaml", "--out", "missing/numbers.csv"),
    ],
)
def test_a_directory_that_is_missing_is_told(
    measured: Path, arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(measured)
    said = str(command(*arguments).exception)
    assert "its directory does not exist" in said
    assert "value: missing" in said


def test_a_machine_as_built_is_a_configuration(measured: Path) -> None:
    done = command("calibrate", measured / "two.csv", "--out", measured / "as-built.txt")
    assert done.exit_code == 2
    assert "NAME.yaml" in done.output


def test_noise_of_an_instrument_is_a_number(measured: Path) -> None:
    done = command("plan", "--calibrate", "8", "--machine", measured / "6-ups.yaml", "--noise", "fine")
    assert "allowed: a number" in str(done.exception)
