"""An installation without a system to install on: its steps, what is refused, and when a release is worse."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.configuration import load, shipped_configuration
from compd.errors import CompdError
from compd.installation import Replacement, SystemCommand, install_problems, install_steps, shipped_file, shipped_units

PROGRAM = Path("/opt/another/bin/compd")


def test_units_start_the_program_and_the_check_comes_before_the_start() -> None:
    steps = install_steps(load(shipped_configuration("tripod-cmm.yaml")), PROGRAM, page=True)
    commands = [str(step) for step in steps]
    unit = next(step.text for step in steps if step.command[-1] == "/etc/systemd/system/compd.service")
    assert unit is not None
    assert f"ExecStart={PROGRAM} run /etc/compd/machine.yaml" in unit
    checked = next(k for k, command in enumerate(commands) if f"{PROGRAM} check" in command)
    assert checked < len(commands) - 1
    assert commands[-1] == "systemctl enable --now compd compd-page"


@pytest.fixture
def packaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory with the package's unit, which starts PROGRAM, and none in /etc."""
    directory = tmp_path / "package"
    directory.mkdir()
    (directory / "compd.service").write_text(shipped_file("compd.service", PROGRAM))
    monkeypatch.setattr(shipped_units, "PACKAGE_UNIT_DIRECTORY", directory)
    monkeypatch.setattr(shipped_units, "UNIT_DIRECTORY", tmp_path / "etc")
    return directory


def test_of_a_package_users_units_and_rule_are_there_already(packaged: Path) -> None:
    steps = install_steps(load(shipped_configuration("tripod-cmm.yaml")), PROGRAM, page=True)
    written = [step.command[-1] for step in steps if step.text is not None]
    assert written == ["/etc/compd/machine.yaml", "/etc/compd/page-tokens.yaml"]
    assert str(steps[-1]) == "systemctl enable --now compd compd-page"


@pytest.mark.parametrize("another", ["program", "unit"])
def test_another_environment_beside_the_package_installs_units_of_its_own(packaged: Path, another: str) -> None:
    if another == "unit":
        own = packaged.with_name("etc")
        own.mkdir()
        (own / "compd.service").write_text(shipped_file("compd.service", PROGRAM))
    program = PROGRAM if another == "unit" else Path("/opt/third/bin/compd")
    steps = install_steps(load(shipped_configuration("tripod-cmm.yaml")), program, page=False)
    assert "/etc/systemd/system/compd.service" in [step.command[-1] for step in steps]


def test_without_the_page_nothing_of_it_is_installed() -> None:
    steps = install_steps(load(shipped_configuration("tripod-cmm.yaml")), PROGRAM, page=False)
    assert not [step for step in steps if "compd-page" in str(step)]


def test_all_reasons_are_told_at_once(tmp_path: Path) -> None:
    text = shipped_configuration("tripod-cmm.yaml").read_text()
    own = tmp_path / "machine.yaml"
    own.write_text(text.replace("/run/compd/", "/srv/compd/").replace("/var/lib/compd", "/srv/state"))
    problems = [str(problem) for problem in install_problems(load(own), PROGRAM, page=False)]
    assert len(problems) == 3
    assert "/opt/another/bin/compd" in problems[0]
    assert "sockets.unix.path" in problems[1]
    assert "state.directory" in problems[2]


def test_a_step_that_fails_tells_its_command_and_what_it_said() -> None:
    with pytest.raises(CompdError, match="nothing of that name"):
        SystemCommand("try", ("sh", "-c", "echo nothing of that name >&2; exit 3")).run()


@pytest.mark.parametrize(
    ("before", "after", "is_worse"),
    [
        ("ok", "ok", False),
        ("ok", "degraded", True),
        ("degraded", "degraded", False),
        ("slewing", "no setpoints", True),
        ("stop", "no setpoints", False),
        ("no setpoints", "starting", False),
    ],
)
def test_a_release_is_worse_where_setpoints_are_not_valid_or_not_ok_any_more(
    before: str, after: str, is_worse: bool
) -> None:
    assert Replacement(before, after, 0.0).is_worse is is_worse
