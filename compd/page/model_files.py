"""The model files in one directory, offered by the page together with the daemon's current models.

A browser names one by its place in this list, and the page opens that file, where it is a regular file and no link. No
path from a browser is opened, nor one that the daemon tells: what a model is called there, some client has said.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from compd.documents import MAX_BYTES
from compd.files import open_regular, read_descriptor
from compd.page.recordings import is_own

# Suffix of files written by `compd model add --model my.model.yaml`; copies beside recordings have another one.
PATTERN = "*model.yaml"
# Most files in the list: more than a person reads, and a limit for an overfull directory.
MOST = 200

Message = Mapping[str, Any]


class ModelFiles:
    """Files in `directory` on the daemon's computer; None if the page has no such directory."""

    def __init__(self, directory: Path | None) -> None:
        self.directory = directory

    def listed(self, models: Message | None) -> list[dict[str, Any]]:
        """Each file as `name`, `changed`, `offered` and `runs` ("applied", "shadow", both or neither).

        models : the message MODEL. What runs and is not in the directory is listed and not offered.
        """
        paths = {path.name: path for path in self._in_directory()}
        own = len(paths)
        for role, path in _running(models):
            if path not in paths.values():
                paths[f"{role}: {path.name}"] = path
        return [
            {
                "name": name,
                "changed": _changed(path) if number < own else None,
                "offered": number < own,
                "runs": " and ".join(_runs(path, models)),
            }
            for number, (name, path) in enumerate(paths.items())
        ]

    def path_of(self, name: str) -> Path | None:
        """The path of an offered name; None for any other."""
        return next((path for path in self._in_directory() if path.name == name), None)

    def _in_directory(self) -> list[Path]:
        if self.directory is None:
            return []
        return sorted(path for path in self.directory.glob(PATTERN) if is_own(path))[:MOST]


def opened(path: Path) -> int:
    """A descriptor of an offered file. Raises OSError, also for a link in its place."""
    return open_regular(path, follow_link=False)


def hash_of_file(path: Path) -> str:
    """Hash of an offered file, as in the daemon's messages. Raises OSError."""
    return hashlib.sha256(read_descriptor(opened(path), MAX_BYTES)).hexdigest()[:16]


def _running(models: Message | None) -> Iterator[tuple[str, Path]]:
    for role in ("applied", "shadow"):
        if file := (models or {}).get(role, {}).get("file"):
            yield role, Path(file)


def _runs(path: Path, models: Message | None) -> list[str]:
    return [role for role, file in _running(models) if file == path]


def _changed(path: Path) -> str | None:
    """None if the file is gone."""
    try:
        return datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(timespec="seconds")
    except OSError:
        return None
