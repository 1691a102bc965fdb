"""The service units, of the daemon and of the page: systemd itself judges them."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.support.paths import ROOT

UNIT = ROOT / "systemd" / "compd.service"
PAGE = ROOT / "systemd" / "compd-page.service"
# `systemd-analyze security --threshold` counts tenths.
WORST_EXPOSURE_TENTHS = 20

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


@pytest.fixture
def installed(tmp_path) -> dict[Path, Path]:
    """The units with a command that exists here: only the path of the program differs."""
    copies = {}
    for unit in (UNIT, PAGE):
        text, count = re.subn(r"(?m)^ExecStart=\S+", f"ExecStart={shutil.which('true')}", unit.read_text())
        assert count == 1
        copies[unit] = tmp_path / unit.name
        copies[unit].write_text(text)
    return copies


@needs_systemd
@pytest.mark.parametrize("unit", [UNIT, PAGE], ids=lambda unit: unit.stem)
def test_verify_finds_nothing_to_say(installed, unit):
    result = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(installed[unit])], capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


@needs_systemd
@pytest.mark.parametrize("unit", [UNIT, PAGE], ids=lambda unit: unit.stem)
def test_exposure_is_at_most_two(installed, unit):
    result = subprocess.run(
        [
            "systemd-analyze",
            "security",
            "--offline=true",
            f"--threshold={WORST_EXPOSURE_TENTHS}",
            "--no-pager",
            str(installed[unit]),
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
        # last readings are believed after a restart, not after another start of the computer
        "Environment=NUMBA_CACHE_DIR=/var/cache/compd PYTHONDONTWRITEBYTECODE=1 COMPD_BOOT_ID=%b",
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


def settings_of(unit: Path) -> dict[str, str]:
    return dict(re.findall(r"(?m)^(\w+)=(.+)$", unit.read_text()))


# What the daemon needs and the page does not, or has more strictly.
OF_THE_DAEMON_ALONE = {
    *("Type", "NotifyAccess", "ExecStart", "ExecReload", "RestartSec", "TimeoutStopSec", "WatchdogSec"),
    *("TimeoutStartSec", "User", "Group", "SupplementaryGroups", "RuntimeDirectory", "RuntimeDirectoryMode"),
    *("StateDirectory", "CacheDirectory", "LimitRTPRIO", "LimitMEMLOCK", "RestrictRealtime", "DeviceAllow"),
    *("Description", "After", "Wants", "Environment"),
}


def test_the_pages_sandbox_is_the_daemons_without_devices_and_real_time():
    daemon, page = settings_of(UNIT), settings_of(PAGE)
    assert {key: page.get(key) for key in daemon if key not in OF_THE_DAEMON_ALONE} == {
        key: value for key, value in daemon.items() if key not in OF_THE_DAEMON_ALONE
    }
    assert page["PrivateDevices"] == page["RestrictRealtime"] == "yes"
    assert "DeviceAllow" not in page


def test_the_page_comes_after_the_daemon_in_everything():
    page = settings_of(PAGE)
    assert int(page["Nice"]) > 0
    assert int(page["CPUWeight"]) < 100, "systemd's default, the daemon's"
    assert (page["MemoryMax"], page["TasksMax"]) == ("4G", "256"), "see docs/explanation/security.md"
    assert page["OOMPolicy"] == "continue", "a worker that takes more memory ends alone"
    assert "compd.service" in page["After"]
    assert "Requires" not in page, "the page starts and stops alone"
    assert "compd-page" not in UNIT.read_text(), "and so does the daemon"


def test_the_page_starts_as_shipped_for_this_computer_alone_and_with_tokens():
    page = PAGE.read_text()
    assert 'Environment="PAGE_ADDRESS=--listen 127.0.0.1"' in page.splitlines()
    assert " --tokens /etc/compd/page-tokens.yaml " in settings_of(PAGE)["ExecStart"]
    users = (ROOT / "systemd" / "compd.sysusers").read_text()
    assert "m compd-page compd" in users.splitlines(), "the group of the daemon's socket"
    assert "m compd compd-page" not in users.splitlines(), "the daemon reads no file of the page's"
