"""Files of effects for kinds of machines: compd's own, and those beside the page's model files."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from compd.configuration import shipped_effects
from compd.errors import StateError

# Name of the file of one's own effects, beside the model files.
OWN_NAME = "own.effects.yaml"
# Suffix of a file of effects beside the model files.
FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}[.-]effects\.yaml")


class EffectLibraries:
    """The choices of a browser by name. directory : of the files beside the shipped ones; may be missing."""

    def __init__(self, directory: Path, but: str) -> None:
        """but : the file of one's own effects, which is always used."""
        self._directory, self._but = directory, but

    def names(self) -> list[str]:
        """Shipped ones first."""
        files = (
            path.name for path in self._directory.glob("*effects.yaml") if path.is_file() and not path.is_symlink()
        )
        return [*shipped_effects(), *sorted(name for name in files if FILE_NAME.fullmatch(name) and name != self._but)]

    def sources(self, names: Iterable[str]) -> list[str]:
        """Each as an argument of `--effects`. Raises StateError for an unknown name."""
        known = self.names()
        chosen = list(dict.fromkeys(names))
        for name in chosen:
            if name not in known:
                raise StateError.of("library of effects", "is not there", value=name, allowed=", ".join(known))
        return [name if name in shipped_effects() else str(self._directory / name) for name in chosen]
