"""Which recordings lie in directories, or match patterns: every sidecar NAME.yaml with its table beside it."""

from __future__ import annotations

import glob
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from compd.configuration.yaml_reader import parse_yaml, read_text
from compd.errors import CompdError, Problem
from compd.recording.sidecar import SECTIONS

# What the table of a recording may end in. Where two tables have one sidecar, the first of these counts.
TABLES = (".csv", ".parquet")


@dataclass(frozen=True)
class FoundRecordings:
    """What lies in the places that were searched.

    Attributes
    ----------
    paths : the table of each recording, absolute, in the order of their names.
    remarks : sidecars without a table, which are no recordings and look like one.
    """

    paths: tuple[Path, ...]
    remarks: tuple[Problem, ...]


def find_recordings(places: Sequence[str | Path]) -> FoundRecordings:
    """Find the recordings in directories, below them at any depth, and among the files that a pattern matches.

    Parameters
    ----------
    places : sequence of str or Path
        Directories, recordings, or patterns as a shell has them: ``"2026-*/**/*.csv"``. A table without a sidecar
        beside it is no recording, and neither is any other YAML file.

    Returns
    -------
    FoundRecordings

    Raises
    ------
    CompdError
        Where a place does not exist, or no recording is in any of them.
    """
    problems: list[Problem] = []
    sidecars: dict[Path, None] = {}
    for place in places:
        matches = [Path(match) for match in _matches(str(place))]
        if not matches:
            problems.append(
                Problem(
                    where=str(place),
                    what="nothing of this name is there",
                    allowed="a directory, a recording, or a pattern in quotes: '2026-*/*.csv'",
                )
            )
        sidecars |= dict.fromkeys(path for match in matches for path in _sidecars(match))
    if problems:
        raise CompdError(problems)
    tables: list[Path] = []
    remarks: list[Problem] = []
    for sidecar in sorted(sidecars):
        beside = [sidecar.with_suffix(ending) for ending in TABLES if sidecar.with_suffix(ending).is_file()]
        tables += beside[:1]
        if not beside and _looks_like_sidecar(sidecar):
            remarks.append(
                Problem(
                    where=str(sidecar),
                    what="is a sidecar without a table, so no recording",
                    allowed=" or ".join(sidecar.with_suffix(ending).name for ending in TABLES) + " beside it",
                )
            )
    if not tables:
        raise CompdError(
            [
                Problem(
                    where=", ".join(map(str, places)),
                    what="has no recording",
                    allowed="NAME.csv or NAME.parquet with its sidecar NAME.yaml beside it",
                    next_step="name the directory in which recordings are",
                ),
                *remarks,
            ]
        )
    return FoundRecordings(tuple(tables), tuple(remarks))


def _matches(place: str) -> list[str]:
    """The files and directories of a name, or of a pattern."""
    return [place] if Path(place).exists() else glob.glob(place, recursive=True)  # noqa: PTH207 - absolute patterns, too


def _sidecars(match: Path) -> Iterator[Path]:
    """The YAML files of a directory; the one beside a file, if there is one."""
    beside: Iterable[Path] = match.rglob("*.yaml") if match.is_dir() else [match.with_suffix(".yaml")]
    return (path.absolute() for path in beside if path.is_file())


def _looks_like_sidecar(path: Path) -> bool:
    """Whether a YAML file names a machine and has no key that a sidecar has not: no configuration, no model file."""
    try:
        data, _ = parse_yaml(read_text(path, "a sidecar"), path)
    except CompdError:
        return False
    return isinstance(data, dict) and "machine" in data and set(data) <= set(SECTIONS)
