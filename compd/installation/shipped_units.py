"""The files for systemd, udev and sysusers that come with compd, and the program that the units start."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from compd.errors import CompdError, Problem
from compd.files import trust_problem

# Directories in the installed package, and in a checkout.
_PLACES = (Path(__file__).parents[1] / "shipped_systemd", Path(__file__).parents[2] / "systemd")
# The program that the shipped units start.
_SHIPPED_PROGRAM = "/opt/compd/bin/compd"
UNIT_DIRECTORY = Path("/etc/systemd/system")
# Of units that a Debian package brings; one of the same name in UNIT_DIRECTORY precedes.
PACKAGE_UNIT_DIRECTORY = Path("/usr/lib/systemd/system")
DAEMON, PAGE = "compd", "compd-page"
# Directories that the units hide from the daemon: ProtectHome=yes and PrivateTmp=yes of systemd.exec(5).
_HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")


def shipped_file(name: str, program: Path) -> str:
    """A shipped file, such as ``compd.service``, whose commands start `program`.

    Raises
    ------
    CompdError
        Where the installation lacks it.
    """
    for place in _PLACES:
        if (place / name).is_file():
            return (place / name).read_text(encoding="utf-8").replace(_SHIPPED_PROGRAM, str(program))
    raise CompdError.of(str(_PLACES[0]), "the shipped units are missing", value=name, next_step="reinstall compd")


def unit_path(unit: str) -> Path:
    """The file of a unit, "compd" or "compd-page": the package's where there is no other; it need not be there."""
    own, packaged = (directory / f"{unit}.service" for directory in (UNIT_DIRECTORY, PACKAGE_UNIT_DIRECTORY))
    return packaged if packaged.exists() and not own.exists() else own


def is_packaged(program: Path) -> bool:
    """Whether units of a Debian package start a program: then users, units and rules are the package's."""
    unit = unit_path(DAEMON)
    return unit.is_relative_to(PACKAGE_UNIT_DIRECTORY) and f"ExecStart={program} " in unit.read_text("utf-8")


def own_program() -> Path:
    """The program ``compd`` of the environment that runs this."""
    return Path(sys.prefix) / "bin" / "compd"


def program_problems(program: Path) -> list[Problem]:
    """Why a service cannot start a program, or must not: it is not there, hidden from it, or others could change it."""
    if not program.is_file():
        return [_program_problem(program, "is not there", "make an environment in /opt, and install compd in it")]
    hidden = [
        _program_problem(
            path,
            "lies where services cannot see it",
            "make the environment in /opt with the system's Python: python3 -m venv /opt/compd, then "
            "/opt/compd/bin/pip install compd",
        )
        for path in (program, Path(os.path.realpath(program.with_name("python3"))))
        if any(path.is_relative_to(directory) for directory in _HIDDEN)
    ]
    untrusted = trust_problem(program.resolve(), "the service's program", "program", {0})
    return [*hidden, *([] if untrusted is None else [untrusted])]


def _program_problem(path: Path, what: str, next_step: str) -> Problem:
    return Problem(
        "the service's program",
        what,
        value=str(path),
        allowed=f"a program outside {', '.join(_HIDDEN)}",
        next_step=next_step,
    )
