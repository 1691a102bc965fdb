"""Drafts of effects in browsers: tried like those of the library, never stored."""

from __future__ import annotations

import hashlib
import json

from compd.comparison import Comparison
from compd.model.effects import Effect
from compd.page.workbench.candidates import Candidates

# Most drafts: browsers that can write at once.
MOST = 16
_DIGITS = 12


class Drafts:
    """The newest drafts beside one comparison, each named after its content: `ram_growth@3f0c9b12a4d7`."""

    def __init__(self, comparison: Comparison, library: Candidates) -> None:
        """library : the known effects; a draft's fit has the same row weights."""
        self._comparison, self._library = comparison, library
        self._candidates: dict[str, Candidates] = {}

    @property
    def effects(self) -> dict[str, Effect]:
        """The drafts by name."""
        return {name: next(iter(candidates.library.values())) for name, candidates in self._candidates.items()}

    def add(self, effect: Effect) -> str:
        """Keep a draft, replacing the oldest beyond the limit; return its name."""
        text = json.dumps(effect.declared, sort_keys=True)
        name = f"{effect.id}@{hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]}"
        candidates = self._candidates.pop(name, None)
        self._candidates[name] = candidates or Candidates(self._comparison, [effect], self._library.problem)
        for oldest in list(self._candidates)[:-MOST]:
            del self._candidates[oldest]
        return name

    def find(self, name: str) -> tuple[Candidates, str]:
        """The candidates that contain an effect, and its id there: a draft, or any other effect of that name."""
        candidates = self._candidates.get(name)
        return (self._library, name) if candidates is None else (candidates, name.partition("@")[0])
