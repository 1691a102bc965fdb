"""Names that commands and their arguments had until 0.3: they work in 0.4, and go with 0.5."""

from __future__ import annotations

import sys
from typing import Any

from compd.cli.options import DEFAULT_SOCKET
from compd.errors import CompdError

OLD_NAMES = {
    "check --drivers": "gauge list",
    "effect list": "model effects",
    "effect show": "model effect",
    **{f"effect {step}": f"model {step}" for step in ("add", "remove", "fit", "undo")},
    "effect": "model",
    "adopt": "model adopt",
    "shadow": "model shadow",
    "ledger": "model ledger",
    "driver test": "gauge test-driver",
    "driver": "gauge",
    "poll": "gauge poll",
    "release": "machine release",
    "record": "recording start",
    "replay": "recording replay",
    "join": "recording join",
    "simulate": "sim run",
    "campaign": "sim campaign",
    "fault": "sim fault",
    "tracker": "sim tracker",
}
# What is a script of a checkout now.
SCRIPTS = {"paper": "examples/paper/reproduce.py", "demo --linuxcnc": "examples/linuxcnc/run.py"}
# Commands that had the daemon's address as their argument.
_ADDRESSED = ("page", "status", "watch", "zero")


def renamed(words: list[str]) -> list[str]:
    """The words of a command line with the command's present name, of which one line on standard error tells."""
    for count in (2, 1):
        old = " ".join(words[:count])
        if script := SCRIPTS.get(old):
            raise CompdError.of(f"compd {old}", "is a script now", next_step=f"run {script} of a checkout")
        if new := OLD_NAMES.get(old):
            _tell(old, new)
            return [*new.split(), *words[count:]]
    return words


def take_address(context: Any, rest: list[str]) -> None:
    """Take a daemon's address that stands without `--daemon` from the rest of a command's words."""
    if context.info_name in _ADDRESSED and context.params.get("daemon") == DEFAULT_SOCKET and len(rest) == 1:
        address = context.params["daemon"] = rest.pop()
        _tell(f"{context.info_name} {address}", f"{context.info_name} --daemon {address}")


def _tell(old: str, new: str) -> None:
    kind = "way" if "--daemon" in new else "name"
    print(f"`compd {old}` is now `compd {new}`; the old {kind} goes with release 0.5", file=sys.stderr)
