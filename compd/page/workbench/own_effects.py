"""Effects of one's own beside the page's model files: one file, written by people and by the page."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from compd.documents import parse_yaml, read_text, with_entries
from compd.errors import CompdError, Problem, StateError
from compd.files import file_stamp, write_files
from compd.model.effects import Effect
from compd.model.formula import formula_effect
from compd.model.library import EFFECTS_FILE, gather_effects

Declaration = Mapping[str, Any]

# Most combinations of searched constants, and most numbers, of an effect: more would take too long in a page.
MAX_COMBINATIONS = 100
MAX_NUMBERS = 36

# Lock of the file, since several workbenches may have it open.
_WRITING = threading.Lock()


class OwnEffects:
    """The effects in one file, which may be missing."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.effects: Mapping[str, Effect] = {}  #: by id; none where the file has a mistake
        self.declarations: Mapping[str, Declaration] = {}  #: by id, as the file has them
        self.problems: tuple[Problem, ...] = ()  #: what is wrong with the file
        self.version = 0  #: counts how often the file was read
        self._stamp: tuple[int, int] | None = None
        self.reload()

    def reload(self) -> None:
        """Read the file anew if it has changed."""
        stamp = file_stamp(self.path)
        if self.version and stamp == self._stamp:
            return
        self.version += 1
        self._stamp = stamp
        self.effects, self.declarations, self.problems = {}, {}, ()
        try:
            declared = entries_of(self._text(), self.path)
            effects = gather_effects(self.path) if declared else {}
            self.declarations = {str(declaration["id"]): declaration for declaration in declared}
        except CompdError as error:
            self.problems = error.problems
            return
        self.problems = tuple(problem for effect in effects.values() for problem in too_large(effect, str(self.path)))
        self.effects = {name: effect for name, effect in effects.items() if not too_large(effect, "")}

    def save(self, declaration: Declaration, replace: bool) -> None:
        """Write an effect into the file; everything else in it stays as it is.

        replace : whether one that has its id may be replaced.
        Raises CompdError with every problem of the declaration; StateError where the id is in the file already, where
        the file has a mistake, or where the disk refuses; ConfigurationError where its text cannot be changed in part.
        """
        effect = formula_effect(declaration, "effect")
        with _WRITING:
            self._refuse_faulty()
            if effect.id in self.declarations and not replace:
                what, step = "has an effect of this id", "replace it, or give this one another id"
                raise StateError.of(str(self.path), what, value=effect.id, next_step=step)
            self._write({**self.declarations, effect.id: declaration})

    def delete(self, effect: str) -> None:
        """Remove an effect from the file, and the file if it is empty then. Raises StateError as `save`."""
        with _WRITING:
            self._refuse_faulty()
            if effect not in self.declarations:
                allowed = ", ".join(self.declarations)
                raise StateError.of(str(self.path), "has no such effect", value=effect, allowed=allowed)
            self._write({name: declared for name, declared in self.declarations.items() if name != effect})

    def _refuse_faulty(self) -> None:
        """Raise StateError for a faulty file, which this page must not overwrite."""
        self.reload()
        if self.problems and not self.declarations:
            raise StateError(self.problems)

    def _write(self, declarations: Mapping[str, Declaration]) -> None:
        before = self._text()
        key, data = EFFECTS_FILE.listed_under, parse_yaml(before, self.path)[0]
        listed = isinstance(data, dict) and key in data
        text = with_entries(before, self.path, key * listed, list(map(dict, declarations.values())))
        try:
            if text.strip():
                write_files({self.path: text})
            else:
                self.path.unlink()
        except OSError as error:
            raise StateError.of(str(self.path), f"cannot be written: {error.strerror}") from error
        self.reload()

    def _text(self) -> str:
        return read_text(self.path, "a file of effects") if self.path.exists() else ""


def entries_of(text: str, path: Path) -> list[Declaration]:
    """The effects declared by a text; none for comments alone.

    path : of the file, for messages. Raises ConfigurationError if it is no YAML.
    """
    data, _ = parse_yaml(text, path, EFFECTS_FILE)
    entries = data.get(EFFECTS_FILE.listed_under, data) if isinstance(data, dict) else data
    if isinstance(entries, list):
        return entries
    return [] if entries is None else [entries]


def too_large(effect: Effect, where: str) -> list[Problem]:
    """Reasons why a page does not try an effect: it would take too long."""
    problems = []
    combinations = math.prod(len(constant.grid) for constant in effect.constants)
    if combinations > MAX_COMBINATIONS:
        problems.append(
            Problem(
                where,
                f"{', '.join(constant.name for constant in effect.constants)} are searched together",
                value=f"{combinations} combinations",
                allowed=f"{MAX_COMBINATIONS} in the page",
                next_step="let the formula be proportional to some of them, or write numbers for them",
            )
        )
    if len(effect.parameters) > MAX_NUMBERS:
        problems.append(
            Problem(
                where,
                "has more parameters than a person can judge",
                value=str(len(effect.parameters)),
                allowed=f"{MAX_NUMBERS} in the page",
            )
        )
    return problems
