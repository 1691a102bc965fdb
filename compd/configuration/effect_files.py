"""Python files whose effects the daemon may compute: the section `effects:`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from compd.documents import AbsolutePath, Document, Section
from compd.errors import PluginError, Problem
from compd.plugins import ListedCode


class EffectFile(Section):
    """One file."""

    file: AbsolutePath = Field(description="absolute path of the file, as models name it in `effect: FILE:NAME`")
    sha256: str = Field(
        pattern="^[0-9a-f]{64}$", description="hash of its content, which `sha256sum FILE` prints: 64 digits"
    )


EffectFiles = Annotated[
    tuple[EffectFile, ...],
    Field(
        description="Python files whose effects the daemon may compute, each with the hash of its content. No other "
        "file is executed for a model, and none of these that has changed. Effects that are formulas, and those of "
        "installed packages, need no entry."
    ),
]


def listed_code(effects: Sequence[EffectFile]) -> ListedCode:
    """The files of the section as arguments of the effect loader."""
    return ListedCode({entry.file: entry.sha256 for entry in effects})


def effect_file_problems(document: Document, effects: Sequence[Any]) -> Iterator[Problem]:
    """Problems of files: listed twice, missing, another hash, loading fails. Each file is executed.

    effects : of the document, as `section.readable` gives it; an entry that has a problem of its own is left out.
    """
    seen: set[str] = set()
    for number, entry in enumerate(effects):
        if not isinstance(entry, EffectFile):
            continue
        where = document.where(("effects", number))
        if entry.file in seen:
            yield Problem(where, "is listed twice", value=entry.file, allowed="each file once", next_step="remove one")
            continue
        seen.add(entry.file)
        try:
            listed_code([entry]).module(Path(entry.file), where, "effect")
        except PluginError as error:
            yield from error.problems
