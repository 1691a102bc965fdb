"""What the doctor finds, and the computer as it sees it."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path

_COMMAND_TIMEOUT_S = 5.0


class Verdict(IntEnum):
    """Of one look: GOOD; UNKNOWN, this user or this computer cannot tell; ADVICE, it works and could be better; FAULT,
    it keeps the daemon from its work. What is larger is to be mended first."""

    GOOD = 0
    UNKNOWN = 1
    ADVICE = 2
    FAULT = 3


@dataclass(frozen=True)
class Finding:
    """One look. subject : what was looked at. what : how it is. next_step : what to do; "" where nothing is."""

    verdict: Verdict
    subject: str
    what: str
    next_step: str = ""


def good(subject: str, what: str) -> Finding:
    """Nothing to do."""
    return Finding(Verdict.GOOD, subject, what)


def fault(subject: str, what: str, next_step: str) -> Finding:
    """It keeps the daemon from its work."""
    return Finding(Verdict.FAULT, subject, what, next_step)


def advice(subject: str, what: str, next_step: str) -> Finding:
    """It works, and could be better."""
    return Finding(Verdict.ADVICE, subject, what, next_step)


def unknown(subject: str, what: str, next_step: str = "") -> Finding:
    """It cannot be seen here."""
    return Finding(Verdict.UNKNOWN, subject, what, next_step)


def _run(command: Sequence[str]) -> str | None:
    """Standard output of a command; None where there is no such command, or it fails or hangs."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_COMMAND_TIMEOUT_S, check=False, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


@dataclass(frozen=True)
class Computer:
    """The computer that is looked at. root : "/", or in tests a directory in its place. run : a command's output."""

    root: Path = Path("/")
    run: Callable[[Sequence[str]], str | None] = field(default=_run)

    def path(self, absolute: str | Path) -> Path:
        """A path of this computer."""
        return self.root / str(absolute).lstrip("/")

    def read(self, absolute: str | Path) -> str | None:
        """Content of a small file without its last line end; None where it cannot be read."""
        try:
            return self.path(absolute).read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            return None

    def resolve(self, absolute: str) -> Path | None:
        """What a path leads to, as a path of this computer; None where there is nothing."""
        path = Path(os.path.realpath(self.path(absolute)))
        if not path.exists():
            return None
        root = Path(os.path.realpath(self.root))
        return Path("/") / path.relative_to(root) if path.is_relative_to(root) else path

    def holders(self, device: Path) -> list[str]:
        """Processes that have a file open, as "compd loop (4711)"; only those that this user may look into."""
        wanted = os.path.realpath(self.path(device))
        found = []
        for process in sorted(self.path("/proc").glob("[0-9]*")):
            try:
                held = any(os.path.realpath(entry) == wanted for entry in (process / "fd").iterdir())
            except OSError:  # it has ended, or belongs to another user
                continue
            if held:
                name = self.read(f"/proc/{process.name}/comm") or "?"
                found.append(f"{name} ({process.name})")
        return found
