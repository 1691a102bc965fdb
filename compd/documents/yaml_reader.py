"""YAML of machines, effects and models: plain data, and the line of every part of it.

The scalars are those of YAML 1.2: `on` is a word, 1e-6 a number, 010 ten. Merge keys (`<<: *anchor`) work. What no
file of this kind needs is refused with its line, before it costs time or memory: collections as keys, tags, anchors
within themselves, aliases that unfold into more than any hand-written file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

try:  # ten times as fast, and in every wheel of PyYAML
    from yaml import CSafeLoader as SafeLoader
except ImportError:
    from yaml import SafeLoader  # type: ignore[assignment]

from compd.errors import ConfigurationError, Problem
from compd.files import FileKind, read_small_file
from compd.text import holds_secret

Location = tuple[str | int, ...]

# Largest file (bytes). A configuration has 20 kB, a sidecar and a model less; a device or a recording given by mistake
# has more.
MAX_BYTES = 1_000_000
# Most levels and nodes, aliases unfolded. A configuration has 6 levels and 2000 nodes, so that these fit every file
# written by a person.
DEEPEST_LEVEL = 50
MAX_NODES = 100_000
# Message of PyYAML 6.0.4 at its own limit (1000 levels), since it reads ahead of the levels counted here.
_LIBRARYS_LIMIT = "maximum nesting depth"
_MAX_KEY = 60
# Quoted parts of a file in PyYAML's messages: an alias, a tag, a character.
_QUOTED = re.compile(r"\s*(?:'[^']*'|\"[^\"]*\")")

_TAG = "tag:yaml.org,2002:"
_MERGE = f"{_TAG}merge"
_SCALARS = tuple(_TAG + name for name in ("str", "int", "float", "bool", "null"))
# Characters outside those allowed in a file (YAML 1.2, section 5.1).
_NOT_YAML = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


class _Loader(SafeLoader):
    """A loader with the scalars of YAML 1.2."""


class _DumpLoader(SafeLoader):
    """A loader with the scalars of YAML 1.1, which PyYAML's dumper quotes by: 12e4 is a word."""


_OF_YAML_1_1 = {_TAG + name for name in ("bool", "float", "int", "timestamp", "value")}
_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _OF_YAML_1_1]
    for first, resolvers in SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver(f"{_TAG}bool", re.compile(r"^(?:true|True|false|False)$"), list("tTfF"))
_Loader.add_implicit_resolver(
    f"{_TAG}int", re.compile(r"^[-+]?[0-9]+$|^0x[0-9a-fA-F]+$|^0o[0-7]+$"), list("-+0123456789")
)
_Loader.add_implicit_resolver(
    f"{_TAG}float",
    # 7E2 stays a word: it is a serial format before it is 700
    re.compile(r"^[-+]?(?:\.\d+|\d+\.\d*)(?:[eE][-+]?\d+)?$|^[-+]?\d+(?:[eE][-+]|e)\d+$|^[-+]?\.inf$|^\.nan$"),
    list("-+.0123456789"),
)


def dotted(location: Location) -> str:
    """('wiring', 'joint', 0, 'link') -> "wiring.joint[1].link"; entries are counted from 1."""
    text = ""
    for part in location:
        text += f"[{part + 1}]" if isinstance(part, int) else f"{'.' if text else ''}{_key_text(part)}"
    return text


def read_text(path: Path, kind: str) -> str:
    """The text of a UTF-8 file. kind : of file, for the message that there is none.

    Raises ConfigurationError for what is no such file: it does not exist, is a directory, a device or a pipe, has more
    than MAX_BYTES, is in another encoding.
    """
    try:
        content = read_small_file(path, MAX_BYTES)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise _unusable(path, f"cannot be read: {why}", next_step=f"give the path of {kind}") from error
    return decode(content, path)


def decode(content: bytes, path: Path) -> str:
    """The text of a file's content. Raises ConfigurationError for too large a file or another encoding."""
    if len(content) > MAX_BYTES:
        raise _unusable(path, "is too large for a file that a person writes", allowed=f"{MAX_BYTES} bytes")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise _unusable(f"{path}:1", "is in UTF-16", allowed="UTF-8", next_step="save the file as UTF-8")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise _unusable(
            f"{path}:{line}",
            "is not in UTF-8",
            allowed="UTF-8",
            next_step="save the file as UTF-8",
        ) from error
    if found := _NOT_YAML.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise _unusable(
            f"{path}:{line}",
            "a character that cannot stand in YAML",
            value=f"U+{ord(found[0]):04X}",
            next_step='delete it; in a text write "\\x.." instead',
        )
    return text


def parse_yaml(
    text: str, path: Path, kind: FileKind | None = None, dumped: bool = False
) -> tuple[Any, dict[Location, int]]:
    """The data of a YAML text, and the line of each part of it, from 1; parts that are merged have those of the anchor.

    kind : of file that it is to be, of which nothing is quoted where it is of another one; None: of a text that the
        person who reads the message has typed.
    dumped : whether compd itself has written it, with PyYAML.
    Raises ConfigurationError with every problem at once, or with the place where the text is no YAML, or where it is of
    another kind.
    """
    loader = _DumpLoader(text) if dumped else _Loader(text)
    try:
        _check_structure(text, path)
        root = loader.get_single_node()
        reading = _Reading(loader, path)
        if root is None:
            data = None
        else:
            _check_size(root, path)
            data = reading.plain(root, ())
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        if _LIBRARYS_LIMIT in (error.problem or ""):
            raise _too_deep(path, line) from error
        what = f"not YAML: {_QUOTED.sub('', error.problem or error.context or 'it ends too soon')}"
        raise _unusable(
            f"{path}:{line}", what, next_step="mend this line; indent with spaces, write `key: value`"
        ) from error
    except yaml.YAMLError as error:
        raise _unusable(path, "not YAML") from error
    finally:
        loader.dispose()
    if kind is not None and not kind.recognises(data):
        raise ConfigurationError(reading.unquoted or kind.refused(path))
    if reading.problems:
        raise ConfigurationError(reading.problems)
    return data, reading.lines


@dataclass
class _Reading:
    """Converts nodes to plain data; the line of every part goes to `lines`, faults to `problems`.

    unquoted : the same problems without the keys and values of the file.
    """

    loader: SafeLoader
    path: Path
    lines: dict[Location, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    unquoted: list[Problem] = field(default_factory=list)

    def plain(self, node: yaml.Node, location: Location) -> Any:
        """Data below `node`."""
        self.lines.setdefault(location, node.start_mark.line + 1)
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, location)
        if isinstance(node, yaml.SequenceNode):
            if node.tag != f"{_TAG}seq":
                self._refuse_tag(node, location)
            return [self.plain(child, (*location, i)) for i, child in enumerate(node.value)]
        assert isinstance(node, yaml.ScalarNode)
        return self._scalar(node, location)

    def _mapping(self, node: yaml.MappingNode, location: Location) -> dict[Any, Any]:
        if node.tag != f"{_TAG}map":
            self._refuse_tag(node, location)
        data: dict[Any, Any] = {}
        own_lines: dict[Any, int] = {}
        for key_node, value_node in node.value:
            if key_node.tag == _MERGE:
                continue
            line = key_node.start_mark.line + 1
            key = self._key(key_node, location)
            here = (*location, key)
            if key in own_lines:
                first = f"given twice, first in line {own_lines[key]}"
                self._add(line, here, first, next_step="keep one of them")
            own_lines[key] = self.lines[here] = line
            data[key] = self.plain(value_node, here)
        for merged in self._merged(node, location):
            # keys of the mapping itself take precedence, then those of the first merged one
            for key_node, value_node in merged.value:
                if key_node.tag == _MERGE:
                    continue
                key = self._key(key_node, location)
                if key not in data:
                    self.lines[*location, key] = key_node.start_mark.line + 1
                    data[key] = self.plain(value_node, (*location, key))
        return data

    def _merged(self, node: yaml.MappingNode, location: Location) -> Iterator[yaml.MappingNode]:
        """The mappings named by `<<`, and those that they merge themselves, in the order of precedence."""
        for key_node, value_node in node.value:
            if key_node.tag != _MERGE:
                continue
            for part in value_node.value if isinstance(value_node, yaml.SequenceNode) else [value_node]:
                if isinstance(part, yaml.MappingNode):
                    yield part
                    yield from self._merged(part, location)
                else:
                    self._add(
                        key_node.start_mark.line + 1,
                        (*location, "<<"),
                        "nothing that can be merged",
                        allowed="an alias of a mapping, or a list of them",
                        next_step="write `<<: *name`, and `&name` where that mapping begins",
                    )

    def _key(self, node: yaml.Node, location: Location) -> Any:
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, location)
        line = node.start_mark.line + 1
        self._add(line, location, "a list or mapping is a key", allowed="a word", next_step="write `key: value`")
        return f"line {line}"

    def _scalar(self, node: yaml.ScalarNode, location: Location) -> Any:
        if node.tag == _MERGE:  # as a value, or as a key of a mapping that is merged
            return node.value
        if node.tag not in _SCALARS:
            self._refuse_tag(node, location)
            return None
        try:
            if node.tag == f"{_TAG}int" and isinstance(self.loader, _Loader):
                return _whole_number(node.value)
            return self.loader.construct_object(node, deep=True)
        except (ValueError, KeyError, TypeError, AttributeError):  # a value that does not fit its tag, or 5000 digits
            kind = node.tag.removeprefix(_TAG)
            self._add(node.start_mark.line + 1, location, f"cannot be read as {kind}", value=_shortened(node.value))
            return None

    def _refuse_tag(self, node: yaml.Node, location: Location) -> None:
        self._add(node.start_mark.line + 1, location, "tags are not used here", next_step="delete the tag")

    def _add(self, line: int, location: Location, what: str, **rest: str) -> None:
        if holds_secret(location):
            rest.pop("value", None)
        where = f"{self.path}:{line}"
        self.problems.append(Problem(f"{where} {dotted(location)}".rstrip(), what, **rest))
        rest.pop("value", None)
        self.unquoted.append(Problem(where, what, **rest))


def _check_structure(text: str, path: Path) -> None:
    """Raise ConfigurationError for too many levels, or a recursive alias."""
    loader = _Loader(text)
    try:
        anchors: list[str | None] = []  # of the open collections
        while loader.check_event():
            event = loader.get_event()
            assert event is not None
            assert event.start_mark is not None
            line = event.start_mark.line + 1
            if isinstance(event, yaml.CollectionStartEvent):
                anchors.append(event.anchor)
                if len(anchors) > DEEPEST_LEVEL:
                    raise _too_deep(path, line)
            elif isinstance(event, yaml.CollectionEndEvent):
                anchors.pop()
            elif isinstance(event, yaml.AliasEvent) and event.anchor in anchors:
                raise _unusable(
                    f"{path}:{line}",
                    "recursive alias",
                    next_step="write out what is meant",
                )
    finally:
        loader.dispose()


def _check_size(root: yaml.Node, path: Path) -> None:
    """Raise ConfigurationError if aliases unfold into more than MAX_NODES nodes, counted without unfolding them."""
    sizes: dict[int, int] = {}

    def size(node: yaml.Node) -> int:
        if id(node) not in sizes:
            children = _children(node)
            sizes[id(node)] = 1 + sum(size(child) for child in children)
        return sizes[id(node)]

    if size(root) <= MAX_NODES:
        return
    node = root
    while large := [child for child in _children(node) if size(child) > MAX_NODES]:
        node = large[0]
    raise _unusable(
        f"{path}:{node.start_mark.line + 1}",
        "more values than a person writes, aliases unfolded",
        value=f"{float(size(root)):.3g}",
        allowed=str(MAX_NODES),
        next_step="use fewer aliases (`*name`) of aliases",
    )


def _children(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, yaml.SequenceNode) else []


def _whole_number(text: str) -> int:
    """Decimal, or with 0x or 0o; a leading zero has no meaning, as in YAML 1.2."""
    digits = text.lstrip("+-")
    base: Mapping[str, int] = {"0x": 16, "0o": 8}
    value = int(digits, base.get(digits[:2].lower(), 10))
    return -value if text.startswith("-") else value


def _key_text(key: object) -> str:
    text = str(key)
    return _shortened(text) if text.isprintable() else repr(_shortened(text))


def _shortened(text: str) -> str:
    return text if len(text) <= _MAX_KEY else f"{text[:_MAX_KEY]} ..."


def _too_deep(path: Path, line: int) -> Exception:
    what = f"more than {DEEPEST_LEVEL} levels, one within the other"
    return _unusable(f"{path}:{line}", what, next_step="close the brackets, or indent less")


def _unusable(where: Path | str, what: str, value: str = "", allowed: str = "", next_step: str = "") -> Exception:
    return ConfigurationError.of(str(where), what, value=value, allowed=allowed, next_step=next_step)
