"""Actions of the workbench as command lines to copy."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from compd.configuration import Machine


class CommandLines(NamedTuple):
    """Command lines for one recording and one model file, which may be created later."""

    recording: Path
    model: Path
    machine: Machine | None

    def all(self, effects: Sequence[str]) -> dict[str, str]:
        """Command lines by action; EFFECT, ROWS and REASON stand for choices. effects : files of effects."""
        recording, model = str(self.recording), str(self.model)
        on = ["--recording", recording, "--model", model, *self._machine]
        words = {
            "compare": ["compare", recording, *self._known, *self._machine],
            "diagnose": ["diagnose", recording, *self._known, *_options(effects), *self._machine],
            "show": ["effect", "show", "EFFECT"],
            "add": ["effect", "add", "EFFECT", *on],
            "remove": ["effect", "remove", "EFFECT", *on],
            "undo": ["effect", "undo", "--model", model],
            "fit": ["effect", "fit", *on],
            "ledger": ["ledger", model],
            "exclude": ["recording", "exclude", recording, "--rows", "ROWS", "--reason", "REASON"],
            "include": ["recording", "include", recording, "--rows", "ROWS"],
        }
        return {name: shlex.join(["compd", *line]) for name, line in words.items()}

    def plan(self, effects: Sequence[str], options: Sequence[str]) -> str:
        """`compd plan` with its options. effects : files of effects."""
        words = ["compd", "plan", str(self.recording), *self._machine, *self._known, *_options(effects)]
        return shlex.join([*words, *options])

    @property
    def _machine(self) -> list[str]:
        return [] if self.machine is None else ["--machine", str(self.machine)]

    @property
    def _known(self) -> list[str]:
        return ["--model", str(self.model)] if self.model.exists() else []


def _options(effects: Sequence[str]) -> list[str]:
    return [word for path in effects for word in ("--effects", path)]
