"""The machine of a recording whose sidecar names a configuration shared by many machines.

A sidecar says `machine: tripod-cmm`: how the machine is built. Of twenty tripods that are built alike, the directory
says which one it is, or a part of the file's name, by a pattern: 'data/{machine}_*.csv'.
"""

from __future__ import annotations

import glob
import os
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING

from compd.errors import Problem
from compd.fleet.name_date import is_date
from compd.text import join_words

if TYPE_CHECKING:
    from compd.fleet.fleet_recording import RecordingFiles

PLACEHOLDER = "{machine}"
_DATE_PLACEHOLDER = "{date}"
# Wildcards of a pattern, and their regular expressions.
_TOKENS: Mapping[str, str] = {
    "**/": "(?:.*/)?",
    "**": ".*",
    "*": "[^/]*",
    "?": "[^/]",
    PLACEHOLDER: "(?P<machine>[^/]+?)",
    _DATE_PLACEHOLDER: r"\d{4}-?\d\d[^/]*?",
}
_TOKEN = re.compile("|".join(map(re.escape, _TOKENS)) + r"|\[[^/\]]+\]")


class MachinesBy(StrEnum):
    """Distinguishing mark of a fleet's machines."""

    auto = "auto"
    directory = "directory"
    sidecar = "sidecar"


def name_machines(
    recordings: Sequence[RecordingFiles], by: MachinesBy = MachinesBy.auto
) -> tuple[list[str], list[Problem]]:
    """The machine of each recording, and remarks on choices that a person may want to change.

    A directory's name is its path below the one that has all recordings, without parts that are dates. By `auto`,
    directories count where recordings of one configuration lie in several of them, and most of them have recordings of
    one configuration only: directories of campaigns have several.
    """
    root = Path(os.path.commonpath([recording.path.parent for recording in recordings]))
    directories = [_directory_name(recording.path, root) for recording in recordings]
    configurations = [recording.configuration for recording in recordings]
    if by is MachinesBy.directory:
        return [d or c for d, c in zip(directories, configurations, strict=True)], []
    if by is MachinesBy.sidecar:
        return configurations, []
    shared = _shared_configurations(configurations, directories)
    if shared:
        return [d or c for d, c in zip(directories, configurations, strict=True)], [_by_directory(shared, str(root))]
    if len(recordings) > 1 and len(set(configurations)) == 1:
        return configurations, [_of_one_machine(configurations[0], len(recordings), str(root))]
    return configurations, []


def machine_in(path: Path, pattern: str) -> str:
    """The text for {machine} in a path that matches the pattern; "" for a pattern without it."""
    match = _expression(pattern).fullmatch(str(path))
    return "" if match is None or PLACEHOLDER not in pattern else match["machine"]


def matches_of(pattern: str) -> list[Path]:
    """The files and directories that a pattern matches, {machine} and {date} with the others."""
    wild = pattern.replace(PLACEHOLDER, "*").replace(_DATE_PLACEHOLDER, "*")
    paths = [Path(match) for match in glob.glob(wild, recursive=True)]  # noqa: PTH207 - absolute patterns, too
    if wild == pattern:
        return paths
    expression = _expression(pattern)
    return [path for path in paths if expression.fullmatch(str(path))]


def _expression(pattern: str) -> re.Pattern[str]:
    """The regular expression of a pattern."""
    text, end = "", 0
    pattern = str(Path(pattern))
    for token in _TOKEN.finditer(pattern):
        text += re.escape(pattern[end : token.start()])
        text += _TOKENS.get(token[0], token[0].replace("[!", "[^"))
        end = token.end()
    return re.compile(text + re.escape(pattern[end:]))


def _directory_name(path: Path, root: Path) -> str:
    return "/".join(part for part in path.parent.relative_to(root).parts if not is_date(part))


def _shared_configurations(configurations: Sequence[str], directories: Sequence[str]) -> dict[str, int]:
    """Configuration -> the number of directories, where machines in several directories have the same."""
    having: dict[str, set[str]] = defaultdict(set)
    lying: dict[str, set[str]] = defaultdict(set)
    for configuration, directory in zip(configurations, directories, strict=True):
        if configuration and directory:
            having[directory].add(configuration)
            lying[configuration].add(directory)
    # a single misnamed recording does not turn a machine's directory into a campaign's
    of_one = sum(len(names) == 1 for names in having.values())
    if 2 * of_one <= len(having):
        return {}
    return {configuration: len(names) for configuration, names in sorted(lying.items()) if len(names) > 1}


def _by_directory(shared: Mapping[str, int], root: str) -> Problem:
    where = join_words([f"of {configuration} in {count} directories" for configuration, count in shared.items()])
    return Problem(
        root,
        f"has recordings {where}: each directory counts as a machine",
        next_step="say otherwise where they are campaigns of one machine: --machines-by sidecar",
    )


def _of_one_machine(machine: str, count: int, root: str) -> Problem:
    return Problem(
        root,
        f"has {count} recordings of one machine, {machine}, as their sidecars say",
        next_step=f"say where the name stands if they are of several: '{root}/{PLACEHOLDER}_*.csv'",
    )
