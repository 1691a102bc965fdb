"""The text of a YAML file with other numbers; comments, order and all other text stay unchanged.

The text is cut where the parser says that a value begins and ends. A round trip through ruamel.yaml would write long
flow collections with other line breaks.
"""

from __future__ import annotations

import copy
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from compd.documents.yaml_reader import Location, dotted, parse_yaml
from compd.errors import ConfigurationError

# A number, a vector, or a word that needs no quotes.
Value: TypeAlias = float | Sequence[float] | str
_PLAIN = re.compile(r"[\w./-]+")


@dataclass
class _Cuts:
    """What is put into a text.

    parts : (begin, end, new text) of numbers.  remarks : on the line, from 0, that they end.
    added : lines of their own below the one that ends at a place.
    """

    parts: list[tuple[int, int, str]] = field(default_factory=list)
    remarks: dict[int, list[str]] = field(default_factory=lambda: defaultdict(list))
    added: list[tuple[int, str]] = field(default_factory=list)


def with_values(text: str, path: Path, values: Mapping[Location, Value], remark: str = "") -> str:
    """The text with these values; a key that its mapping lacks is added to it.

    path : of the file, for messages.
    remark : begins a comment at the end of the line of each value that is replaced or added, after which its key and
        what stood there follow; "" for no comments. A line that has such a comment of the same key keeps it.

    Raises ConfigurationError where the place is missing, or is written once for several places (an anchor).
    """
    data, lines = parse_yaml(text, path)
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert root is not None
    cuts, wanted = _Cuts(), copy.deepcopy(data)
    uses = _uses(root)
    for location, value in values.items():
        where = f"{path}:{lines.get(location, lines.get(location[:-1], 1))} {dotted(location)}"
        parent = _child(root, location[:-1], uses, where)
        old = _found(parent, location[-1])
        said = f"{_key(location)} {'not stated' if old is None else _before(text, old)}" if remark else ""
        if old is None:
            _add(cuts, parent, str(location[-1]), value, (remark, said) if remark else (), where)
        else:
            _replace(cuts, _child(parent, location[-1:], uses, where), value, where)
            cuts.remarks[_end(old).line] += [said] * bool(said)
        _set(wanted, location, value)
    edited = _cut(text, cuts, remark)
    if parse_yaml(edited, path)[0] != wanted:
        raise _unusual(str(path))
    return edited


def _uses(root: yaml.Node) -> Mapping[int, int]:
    """How often each node stands in the document, by its id: an anchor is one node in several places."""
    uses: dict[int, int] = defaultdict(int)
    open_nodes = [root]
    while open_nodes:
        node = open_nodes.pop()
        uses[id(node)] += 1
        if uses[id(node)] == 1 and isinstance(node, yaml.CollectionNode):
            children = [part for entry in node.value for part in (entry if isinstance(entry, tuple) else (entry,))]
            open_nodes += children
    return uses


def _child(node: yaml.Node, location: Location, uses: Mapping[int, int], where: str) -> yaml.Node:
    """The node at a place below `node`. Raises ConfigurationError where there is none, or one for several places."""
    for part in location:
        child = _found(node, part)
        if child is None or uses[id(child)] > 1:
            what = "is missing, or merged from an anchor" if child is None else "is written once for several places"
            raise ConfigurationError.of(where, what, next_step="write the values out in each place, without an anchor")
        node = child
    return node


def _found(node: yaml.Node, part: str | int) -> yaml.Node | None:
    if isinstance(node, yaml.SequenceNode) and isinstance(part, int):
        return node.value[part] if part < len(node.value) else None
    if isinstance(node, yaml.MappingNode):
        return next((value for key, value in node.value if key.value == part), None)
    return None


def _replace(cuts: _Cuts, node: yaml.Node, value: Value, where: str) -> None:
    """Number by number, so that comments between the numbers of a vector stay."""
    if isinstance(node, yaml.ScalarNode):
        cuts.parts.append((node.start_mark.index, node.end_mark.index, value_as_yaml(value)))
        return
    children = node.value if isinstance(node, yaml.SequenceNode) else []
    if isinstance(value, float | int | str) or len(children) != len(value):
        raise _unusual(where)
    for child, number in zip(children, value, strict=True):
        _replace(cuts, child, number, where)


def _add(cuts: _Cuts, parent: yaml.Node, key: str, value: Value, comment: Sequence[str], where: str) -> None:
    """The key at the end of its mapping. comment : how it begins, and what it says; empty for none."""
    if not isinstance(parent, yaml.MappingNode) or not parent.value:
        raise _unusual(where)
    entry, end = f"{key}: {value_as_yaml(value)}", _end(parent.value[-1][1])
    if parent.flow_style:
        cuts.parts.append((end.index, end.index, f", {entry}"))
        cuts.remarks[end.line] += comment[1:]
    else:
        indent = " " * parent.value[0][0].start_mark.column
        cuts.added.append((end.line, f"\n{indent}{entry}{'  # ' * bool(comment)}{' '.join(comment)}"))


def value_as_yaml(value: Value) -> str:
    """A value as YAML in one line, with as many digits as it has."""
    if isinstance(value, str):
        return value if _PLAIN.fullmatch(value) else yaml.safe_dump(value, default_style='"', width=10_000).strip()
    if isinstance(value, float | int):
        text = repr(float(value) + 0.0).removesuffix(".0")
        # 1e-06 is a number of YAML 1.1 only with a point
        return text if "e" not in text or "." in text else text.replace("e", ".0e")
    return f"[{', '.join(map(value_as_yaml, value))}]"


def _set(data: Any, location: Location, value: Value) -> None:
    for part in location[:-1]:
        data = data[part]
    data[location[-1]] = value if isinstance(value, float | int | str) else list(value)


def _key(location: Location) -> str:
    """The key of a value, without the numbers of lists that it stands in."""
    return next(part for part in reversed(location) if isinstance(part, str))


def _before(text: str, node: yaml.Node) -> str:
    if isinstance(node, yaml.SequenceNode):
        return f"[{', '.join(_before(text, child) for child in node.value)}]"
    return text[node.start_mark.index : node.end_mark.index]


def _end(node: yaml.Node) -> yaml.Mark:
    """End of a node; a collection in block style ends with its last value, and not where the next one starts."""
    if isinstance(node, yaml.CollectionNode) and node.value and not node.flow_style:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    assert node.end_mark is not None
    return node.end_mark


def _cut(text: str, cuts: _Cuts, remark: str) -> str:
    """The text with all parts put in; at the end of a line first its comment, then the lines that are added below."""
    commented, ends = _commented_lines(text), [match.start() for match in re.finditer(r"\n|\Z", text)]
    parts = [(begin, end, 0, new) for begin, end, new in cuts.parts]
    for line, remarks in cuts.remarks.items():
        own = text[ends[line - 1] + 1 if line else 0 : ends[line]]
        kept = own[own.rindex(remark) :] if line in commented and remark in own else ""
        fresh = [one for one in remarks if f"{one.split(' ', 1)[0]} " not in kept]
        if fresh:
            before = ", " if kept else f"; {remark} " if line in commented else f"  # {remark} "
            parts.append((ends[line], ends[line], 1, f"{before}{', '.join(fresh)}"))
    parts += [(ends[line], ends[line], order, new) for order, (line, new) in enumerate(cuts.added, start=2)]
    for begin, end, _, new in sorted(parts, key=lambda part: part[:3], reverse=True):
        text = text[:begin] + new + text[end:]
    return text


def _commented_lines(text: str) -> set[int]:
    """Lines, from 0, that end in a comment."""
    last_token = {token.end_mark.line: token.end_mark.column for token in yaml.scan(text, Loader=yaml.SafeLoader)}
    return {i for i, line in enumerate(text.split("\n")) if "#" in line[last_token.get(i, 0) :]}


def _unusual(where: str) -> ConfigurationError:
    return ConfigurationError.of(
        where,
        "is written so that its numbers cannot be replaced one by one",
        allowed="numbers, and vectors as [x, y, z]",
        next_step="write it so",
    )
