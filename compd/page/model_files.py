"""The model files that the page offers: those in one directory, and those that the daemon runs with.

A browser names one by its place in this list, and the page finds the file. An absolute path is passed on to the daemon,
which reads it as it does for `compd adopt`; the page itself never opens, nor looks for, a file that a browser names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

# As `compd effect add --model my.model.yaml` writes them; copies beside recordings end otherwise.
PATTERN = "*model.yaml"
# More than anybody reads, and less than a directory that somebody filled.
MOST = 200

Message = Mapping[str, Any]


class ModelFiles:
    """Those in `directory`, of the daemon's computer; None where the page was not told one."""

    def __init__(self, directory: Path | None) -> None:
        self.directory = directory

    def listed(self, models: Message | None) -> list[dict[str, Any]]:
        """Each as `name`, `changed` and `runs`: "applied", "shadow", both, or nothing. `models`: the message MODEL."""
        return [
            {"name": name, "changed": _changed(path), "runs": " and ".join(_runs(path, models))}
            for name, path in self._paths(models).items()
        ]

    def path_of(self, subject: str, models: Message | None) -> str | None:
        """The path of a listed name, or the absolute path that `subject` is; None for anything else."""
        if subject.startswith("/"):
            return subject
        path = self._paths(models).get(subject)
        return None if path is None else str(path)

    def _paths(self, models: Message | None) -> dict[str, Path]:
        paths = {path.name: path for path in self._in_directory()}
        for role, path in _running(models):
            if path not in paths.values():
                paths[f"{role}: {path.name}"] = path
        return paths

    def _in_directory(self) -> list[Path]:
        if self.directory is None:
            return []
        return sorted(path for path in self.directory.glob(PATTERN) if path.is_file())[:MOST]


def _running(models: Message | None) -> Iterator[tuple[str, Path]]:
    for role in ("applied", "shadow"):
        if file := (models or {}).get(role, {}).get("file"):
            yield role, Path(file)


def _runs(path: Path, models: Message | None) -> list[str]:
    return [role for role, file in _running(models) if file == path]


def _changed(path: Path) -> str | None:
    """None where the file is gone: the daemon has read it, and goes on."""
    try:
        return datetime.fromtimestamp(path.stat().st_mtime, UTC).isoformat(timespec="seconds")
    except OSError:
        return None
