"""A YAML document with the line of every key, so that a problem can name it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

try:  # ten times as fast, and in every wheel of PyYAML
    from yaml import CSafeLoader as SafeLoader
except ImportError:
    from yaml import SafeLoader  # type: ignore[assignment]

from compd.errors import ConfigurationError, Problem

Location = tuple[str | int, ...]


class _Loader(SafeLoader):
    """A loader with the scalars of YAML 1.2: `on` is a word, 1e-6 a number."""


_Loader.yaml_implicit_resolvers = {
    first: [
        (tag, pattern)
        for tag, pattern in resolvers
        if tag not in {"tag:yaml.org,2002:bool", "tag:yaml.org,2002:float", "tag:yaml.org,2002:timestamp"}
    ]
    for first, resolvers in SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver("tag:yaml.org,2002:bool", re.compile(r"^(?:true|True|false|False)$"), list("tTfF"))
_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    # 7E2 stays a word: it is a serial format before it is 700
    re.compile(r"^[-+]?(?:\.\d+|\d+\.\d*)(?:[eE][-+]?\d+)?$|^[-+]?\d+(?:[eE][-+]|e)\d+$|^[-+]?\.inf$|^\.nan$"),
    list("-+.0123456789"),
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
        """`file:line key.path` of the deepest part of `location` that the file has."""
        for length in range(len(location), -1, -1):
            if location[:length] in self.lines:
                return f"{self.path}:{self.lines[location[:length]]} {dotted(location)}".rstrip()
        return f"{self.path} {dotted(location)}".rstrip()

    def value(self, location: Location) -> Any:
        """The value at `location`; None where the file has none."""
        value: Any = self.data
        for part in location:
            try:
                value = value[part]
            except (KeyError, IndexError, TypeError):
                return None
        return value


def dotted(location: Location) -> str:
    """('wiring', 'joint', 0, 'link') -> "wiring.joint[1].link"; entries are counted from 1, as people do."""
    text = ""
    for part in location:
        text += f"[{part + 1}]" if isinstance(part, int) else f"{'.' if text else ''}{part}"
    return text


def read_document(path: Path) -> Document:
    """Read a YAML file of sections: a configuration, a sidecar, a preset.

    Raises ConfigurationError for a file that is missing, is not YAML, or has a key twice.
    """
    data, lines = _read(path, "a configuration file")
    if not isinstance(data, dict):
        raise ConfigurationError(Problem(where=str(path), what="must hold `key: value` sections at its top"))
    return Document(path, data, lines)


def read_entries(path: Path, key: str) -> Document:
    """Read a YAML file of entries: a list, a mapping that has the list under `key`, or a single entry by itself.

    The document has the list under `key` in any case; a single entry is not a list: the mapping itself.
    Raises ConfigurationError as `read_document` does, and for a file that is none of the three.
    """
    data, lines = _read(path, f"a file of {key}")
    if isinstance(data, dict) and key in data:
        return Document(path, data, lines)
    if not isinstance(data, list | dict):
        allowed = f"a list of {key}, `{key}:` with that list, or a single one"
        raise ConfigurationError(Problem(where=str(path), what=f"holds no {key}", allowed=allowed))
    return Document(path, {key: data}, {(key, *location): line for location, line in lines.items()})


def _read(path: Path, kind: str) -> tuple[Any, dict[Location, int]]:
    """The data of a YAML file, and the line of each part of it. kind : of file, for the message that there is none."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(
            Problem(where=str(path), what=f"cannot be read: {error}", next_step=f"give the path of {kind}")
        ) from error
    loader = _Loader(text)
    try:
        root = loader.get_single_node()
        problems: list[Problem] = []
        lines: dict[Location, int] = {}
        data = _plain(loader, root, (), lines, problems, path) if root is not None else None
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise ConfigurationError(
            Problem(
                where=f"{path}:{line}",
                what=f"not YAML: {error.problem or error.context}",
                next_step="mend this line; indent with spaces, write `key: value`",
            )
        ) from error
    finally:
        loader.dispose()
    if problems:
        raise ConfigurationError(problems)
    return data, lines


def _plain(
    loader: _Loader,
    node: yaml.Node,
    location: Location,
    lines: dict[Location, int],
    problems: list[Problem],
    path: Path,
) -> Any:
    """Data below `node`; the line of every key goes to `lines`, keys that come twice to `problems`."""
    lines.setdefault(location, node.start_mark.line + 1)
    if isinstance(node, yaml.MappingNode):
        result: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key = loader.construct_object(key_node, deep=True)
            here = (*location, key)
            line = key_node.start_mark.line + 1
            if key in result:
                problems.append(
                    Problem(
                        where=f"{path}:{line} {dotted(here)}",
                        what=f"said twice, first in line {lines[here]}",
                        next_step="keep one of them",
                    )
                )
            lines[here] = line
            result[key] = _plain(loader, value_node, here, lines, problems, path)
        return result
    if isinstance(node, yaml.SequenceNode):
        return [_plain(loader, child, (*location, i), lines, problems, path) for i, child in enumerate(node.value)]
    return loader.construct_object(node, deep=True)
