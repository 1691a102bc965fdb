"""The service unit: systemd itself judges it."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.paths import ROOT

UNIT = ROOT / "systemd" / "compd.service"
# `systemd-analyze security --threshold` counts tenths.
WORST_EXPOSURE_TENTHS = 20

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


@pytest.fixture
def installed(tmp_path) -> Path:
    """The unit with a command that exists here: only the path of the program differs."""
    text, count = re.subn(r"(?m)^ExecStart=\S+", f"ExecStart={shutil.which('true')}", UNIT.read_text())
    assert count == 1
    path = tmp_path / UNIT.name
    path.write_text(text)
    return path


@needs_systemd
def test_verify_finds_nothing_to_say(installed):
    result = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(installed)], capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


@needs_systemd
def test_exposure_is_at_most_two(installed):
    result = subprocess.run(
        [
            "systemd-analyze",
            "security",
            "--offline=true",
            f"--threshold={WORST_EXPOSURE_TENTHS}",
            "--no-pager",
            str(installed),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout.splitlines()[-1:]


@pytest.mark.parametrize(
    "line",
    [
        "Type=notify",
        "RestrictRealtime=no",
        "LimitMEMLOCK=infinity",
        "SupplementaryGroups=dialout",
        "DeviceAllow=char-ttyUSB rw",
        "DeviceAllow=/dev/cpu_dma_latency w",
    ],
)
def test_what_the_daemon_cannot_do_without(line):
    assert line in UNIT.read_text().splitlines()


def test_the_watchdog_and_the_priority_fit_the_daemon():
    settings = dict(re.findall(r"(?m)^(\w+)=(.+)$", UNIT.read_text()))
    assert float(settings["WatchdogSec"]) > 0
    assert int(settings["LimitRTPRIO"]) >= 98, "the largest loop.priority that a configuration may ask for"
    assert settings["NotifyAccess"] == "main"
