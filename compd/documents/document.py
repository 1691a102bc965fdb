"""A YAML document with the line of every key, for the messages of problems."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compd.documents.yaml_reader import Location, dotted, parse_yaml, read_text
from compd.files import FileKind

__all__ = ["CONFIGURATION", "Document", "Location", "dotted", "read_document", "read_entries"]

# Sections that mark a configuration: two, since a recording's sidecar has the machine's name, too.
CONFIGURATION = FileKind(
    "a machine's configuration",
    frozenset({"machine", "geometry", "lines", "gauges", "wiring", "loop", "limits", "sockets", "state"}),
    least=2,
    others=frozenset({"acquisition", "votes", "effects"}),
)


@dataclass(frozen=True)
class Document:
    """Parsed YAML.

    data : the top level's keys and values. lines : location -> line, from 1.
    """

    path: Path
    data: dict[str, Any]
    lines: dict[Location, int]

    def where(self, location: Location) -> str:
        """`file:line key.path` of the deepest existing part of `location`."""
        for length in range(len(location), -1, -1):
            if location[:length] in self.lines:
                return f"{self.path}:{self.lines[location[:length]]} {self._dotted(location)}".rstrip()
        return f"{self.path} {self._dotted(location)}".rstrip()

    def _dotted(self, location: Location) -> str:
        """The location in words, in which a number that is a key is no place in a list."""
        return dotted(
            tuple(str(part) if isinstance(self.value(location[:i]), dict) else part for i, part in enumerate(location))
        )

    def value(self, location: Location) -> Any:
        """The value at `location`; None if the file has none."""
        value: Any = self.data
        for part in location:
            try:
                value = value[part]
            except (KeyError, IndexError, TypeError):
                return None
        return value


def read_document(path: Path, kind: FileKind = CONFIGURATION) -> Document:
    """Read a YAML file of sections: a configuration, a sidecar, a preset.

    Raises ConfigurationError for a file that cannot be read, is not YAML or not of this kind, with every problem of the
    YAML at once.
    """
    data, lines = parse_yaml(read_text(path, kind.name), path, kind)
    return Document(path, data, lines)


def read_entries(path: Path, kind: FileKind) -> Document:
    """Read a YAML file of entries: a list, a mapping that has the list under `kind.listed_under`, or a single entry.

    The document has the list under that key in any case; a single entry is not a list: the mapping itself.
    Raises ConfigurationError as `read_document` does, and for a file that is none of the three.
    """
    key = kind.listed_under
    data, lines = parse_yaml(read_text(path, kind.name), path, kind)
    if isinstance(data, dict) and key in data:
        return Document(path, data, lines)
    return Document(path, {key: data}, {(key, *location): line for location, line in lines.items()})
