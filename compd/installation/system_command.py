"""One step of an installation: a command that a person could type, with what it is for."""

from __future__ import annotations

import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass

from compd.errors import CompdError, Problem


@dataclass(frozen=True)
class SystemCommand:
    """A command of an installation.

    purpose : what it does, for people. command : program and arguments. text : what the program reads.
    """

    purpose: str
    command: tuple[str, ...]
    text: str | None = None

    def __str__(self) -> str:
        return shlex.join(self.command)

    def run(self) -> str:
        """What the command prints.

        Raises
        ------
        CompdError
            Where it is not there or fails, with what it says.
        """
        try:
            done = subprocess.run(
                self.command, input=self.text or "", capture_output=True, text=True, check=False, cwd="/"
            )
        except OSError as error:
            raise CompdError(self._problem(f"cannot be run: {error.strerror}")) from None
        if done.returncode:
            raise CompdError(self._problem((done.stderr or done.stdout).strip() or f"exit code {done.returncode}"))
        return done.stdout

    def _problem(self, why: str) -> Problem:
        return Problem(
            str(self),
            f"failed: {self.purpose}",
            value=why,
            next_step="mend what it says, then give the same command again: steps that are done do no harm twice",
        )


def installed_file(path: str, text: str, purpose: str, mode: str = "644", owner: Sequence[str] = ()) -> SystemCommand:
    """The step that writes a file, with the directories above it. owner : user and group; root's where it is empty."""
    ownership = ("-o", owner[0], "-g", owner[1]) if owner else ()
    return SystemCommand(purpose, ("install", "-D", "-m", mode, *ownership, "/dev/stdin", path), text)
