"""A stand-in for the system that a page installs into: directories of its own, and stand-ins for a few programs.

What a page writes below /opt, /etc and /usr/lib goes into the stage. `sudo` runs the command that follows.
`python3 -m venv` makes an environment whose pip does not install, but checks what it is told (.ci/run builds and
installs the wheel). Of its compd `service install` does its steps in the stage, but for those that only a system can
do; a test in a container upgrades and goes back. `systemctl` checks that what it is told to start could be started.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

from compd.configuration import load
from compd.installation import install_steps
from tests.support.paths import ROOT

PREFIXES = ("/opt/", "/etc/", "/usr/lib/")
PROGRAMS = ("sudo", "python3", "systemctl")
# Directories that a system has before anything is installed.
DIRECTORIES = ("opt", "etc/systemd/system")


def staged(command: str, stage: Path) -> str:
    """The command with the stage in front of every path that a page installs into."""
    for prefix in PREFIXES:
        command = re.sub(rf"(?<![\w/.]){prefix}", f"{stage}{prefix}", command)
    return command


def make_stage(directory: Path) -> Path:
    """Make the stage below `directory`; its stand-ins are in `bin`."""
    stage = directory / "stage"
    for name in DIRECTORIES:
        (stage / name).mkdir(parents=True)
    (stage / "bin").mkdir()
    for name in PROGRAMS:
        _write_program(stage / "bin" / name, stage, name)
    (directory / "systemd").symlink_to(ROOT / "systemd")
    return stage


def _write_program(path: Path, stage: Path, name: str) -> None:
    path.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m tests.support.staging "{stage}" {name} "$@"\n')
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def _sudo(_: Path, arguments: list[str]) -> None:
    os.execvp(arguments[0], arguments)


def _python3(stage: Path, arguments: list[str]) -> None:
    match arguments:
        case ["-m", "venv", directory]:
            programs = Path(directory) / "bin"
            programs.mkdir(parents=True)
            for name in ("pip", "compd"):
                _write_program(programs / name, stage, name)
        case _:
            raise SystemExit(f"python3: the stage has no {arguments}")


def _pip(_: Path, arguments: list[str]) -> None:
    if arguments != ["install", "dist/compd-*.whl"]:
        raise SystemExit(f"pip: not what `make wheel` builds: {arguments}")


def _compd(stage: Path, arguments: list[str]) -> None:
    match arguments:
        case ["service", "install", configuration]:
            for step in install_steps(load(Path(configuration)), Path("/opt/compd/bin/compd"), page=True):
                match step.command:
                    case ["install", "-D", *_, path]:
                        target = Path(staged(path, stage))
                        target.parent.mkdir(parents=True, exist_ok=True)
                        target.write_text(step.text or "")
                        target.chmod(int(step.command[3], 8))
                    case ["systemd-sysusers"]:
                        _sysusers(stage)
                    case ["systemctl", *rest]:
                        _systemctl(stage, rest)
        case ["service", "upgrade" | "back"]:
            pass
        case _:
            os.execv(Path(sys.executable).parent / "compd", ["compd", *arguments])


def _sysusers(stage: Path) -> None:
    program = shutil.which("systemd-sysusers", path="/usr/bin:/bin")
    if program is None:
        print("systemd-sysusers is not installed: not checked")
        return
    subprocess.run([program, f"--root={stage}"], check=True)
    if "\ncompd:" not in "\n" + (stage / "etc/passwd").read_text():
        raise SystemExit("systemd-sysusers made no user compd")


def _systemctl(stage: Path, arguments: list[str]) -> None:
    match arguments:
        case ["daemon-reload"]:
            pass
        case ["restart", name] if (stage / f"etc/systemd/system/{name}.service").is_file():
            pass
        case ["enable", "--now", *names]:
            for name in names:
                _check_unit(stage, stage / f"etc/systemd/system/{name}.service")
        case _:
            raise SystemExit(f"systemctl: the stage has no {arguments}")


def _check_unit(stage: Path, unit: Path) -> None:
    """The unit's program and configuration are there, its user has been made, and systemd accepts it."""
    text = unit.read_text()
    start = re.search(r"(?m)^ExecStart=(\S+) (?:run|page --daemon) (\S+)(?: .*)?$", text)
    user = re.search(r"(?m)^User=(\S+)$", text)
    assert start is not None, text
    assert user is not None, text
    program, configuration = (Path(staged(name, stage)) for name in start.groups())
    subprocess.run([program, "check", configuration], check=True, stdout=subprocess.DEVNULL)
    assert re.search(rf"(?m)^u {user[1]} ", (stage / "etc/sysusers.d/compd.conf").read_text())
    if shutil.which("systemd-analyze") is None:
        print("systemd-analyze is not installed: the unit is not verified")
        return
    copy = stage / unit.name
    copy.write_text(text.replace(start[1], str(program)))
    subprocess.run(["systemd-analyze", "verify", "--man=no", str(copy)], check=True)


MAIN = {
    **{"sudo": _sudo, "python3": _python3, "pip": _pip},
    **{"compd": _compd, "systemctl": _systemctl},
}

if __name__ == "__main__":
    MAIN[sys.argv[2]](Path(sys.argv[1]), sys.argv[3:])
