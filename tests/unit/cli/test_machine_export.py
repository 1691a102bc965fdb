"""`compd machine export`: the numbers of a machine for other programs."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from compd.cli.app import app
from compd.errors import CompdError


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)))


def test_settings_and_table(tmp_path: Path) -> None:
    machine = tmp_path / "delta.yaml"
    assert run("machine", "new", "--kind", "linear-delta", "--out", machine).exit_code == 0
    for shape, mark in (
        ("klipper", "delta_radius: 155"),
        ("reprapfirmware", "M665 L337.67588"),
        ("csv", "part,number"),
    ):
        out = tmp_path / f"settings.{shape}"
        done = run("machine", "export", machine, "--as", shape, "--bed", "-400", "--out", out)
        assert done.exit_code == 0, done.output
        assert mark in out.read_text(encoding="utf-8")
        # a file is never written over by mistake
        assert run("machine", "export", machine, "--as", shape, "--out", out).exit_code == 2


def test_another_machine_is_refused_with_the_table_as_the_way_on(tmp_path: Path) -> None:
    machine = tmp_path / "hexapod.yaml"
    run("machine", "new", "--kind", "6-ups", "--out", machine)
    done = run("machine", "export", machine, "--as", "klipper")
    assert isinstance(done.exception, CompdError)
    with pytest.raises(CompdError, match=r"is no linear delta with upright rails(.|\n)*--as csv"):
        raise done.exception
    assert run("machine", "export", machine).exit_code == 0
