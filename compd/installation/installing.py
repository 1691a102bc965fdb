"""The steps that install the daemon, and its page, as services of systemd."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from compd.configuration import Configuration
from compd.errors import Problem
from compd.installation.shipped_units import (
    DAEMON,
    PAGE,
    UNIT_DIRECTORY,
    is_packaged,
    program_problems,
    shipped_file,
)
from compd.installation.system_command import SystemCommand, installed_file

MACHINE = Path("/etc/compd/machine.yaml")
_TOKENS = Path("/etc/compd/page-tokens.yaml")
# What the units give the daemon: RuntimeDirectory= and StateDirectory= of compd.service.
_RUNTIME, _STATE = Path("/run/compd"), Path("/var/lib/compd")
# The daemon as its unit runs it, for commands that are to see what it sees.
_AS_THE_DAEMON = ("setpriv", "--reuid=compd", "--regid=compd", "--init-groups", "--reset-env", "--")
_KERNELS = "NUMBA_CACHE_DIR=/var/cache/compd"


def install_problems(configuration: Configuration, program: Path, page: bool) -> list[Problem]:
    """Why a configuration cannot run as the installed service; every reason at once."""
    problems = program_problems(program)
    places = (
        ("sockets.unix.path", Path(configuration.sockets.unix.path), _RUNTIME),
        ("state.directory", Path(configuration.state.directory), _STATE),
    )
    for key, path, below in places:
        if not path.is_relative_to(below):
            problems.append(
                Problem(
                    f"{configuration.path}: {key}",
                    "the service may not write there",
                    value=str(path),
                    allowed=f"a path below {below}",
                    next_step=f"correct it, or widen the unit with `systemctl edit {DAEMON}` and install it by hand",
                )
            )
    if page and find_spec("starlette") is None:
        problems.append(
            Problem(
                "the page in the browser",
                "what it needs is not installed",
                value="starlette",
                next_step=f"{program.with_name('pip')} install 'compd[page]'; or leave the page out: --no-page",
            )
        )
    return problems


def install_steps(configuration: Configuration, program: Path, page: bool) -> list[SystemCommand]:
    """The steps, in their order; each may be done again. Those that a Debian package has done are not among them.

    Parameters
    ----------
    configuration : of the machine; its file is copied to /etc/compd/machine.yaml.
    program : the program ``compd`` that the services start.
    page : whether the page in the browser is installed, too. A file of its tokens that is there is kept.
    """
    text = configuration.path.read_text(encoding="utf-8")
    units = (DAEMON, PAGE) if page else (DAEMON,)
    packaged = is_packaged(program)
    steps = [] if packaged else _user_steps(program)
    steps += [
        installed_file(str(MACHINE), text, "the machine's configuration"),
        SystemCommand(
            "a directory for what is compiled",
            ("install", "-d", "-m", "700", "-o", DAEMON, "-g", DAEMON, "/var/cache/compd"),
        ),
        check_step(program),
    ]
    if not packaged:
        steps += _system_steps(program, units)
    if page and not _TOKENS.exists():
        steps.append(installed_file(str(_TOKENS), "", "an empty file of tokens", "600", (PAGE, PAGE)))
    return [
        *steps,
        SystemCommand("systemd reads the units", ("systemctl", "daemon-reload")),
        SystemCommand("start now, and with the computer", ("systemctl", "enable", "--now", *units)),
    ]


def _user_steps(program: Path) -> list[SystemCommand]:
    return [
        installed_file("/etc/sysusers.d/compd.conf", shipped_file("compd.sysusers", program), "name the users"),
        SystemCommand("make the users", ("systemd-sysusers",)),
    ]


def _system_steps(program: Path, units: Sequence[str]) -> list[SystemCommand]:
    rules = shipped_file("compd.rules", program)
    return [
        installed_file("/etc/udev/rules.d/70-compd.rules", rules, "permit processors to stay awake"),
        *(
            installed_file(str(UNIT_DIRECTORY / name), shipped_file(name, program), f"the unit {name}")
            for name in (f"{unit}.service" for unit in units)
        ),
    ]


def check_step(program: Path) -> SystemCommand:
    """The step that checks the installed configuration as the daemon's user, and compiles what the daemon needs."""
    return SystemCommand(
        "check the configuration as the daemon's user; kernels are compiled where there are none",
        (*_AS_THE_DAEMON, "env", _KERNELS, str(program), "check", str(MACHINE)),
    )
