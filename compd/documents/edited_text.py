"""The one editor of YAML text: values and entries change; comments, order and all other text stay.

The text is cut where the parser says that a value begins and ends. A round trip through ruamel.yaml would write long
flow collections with other line breaks, and lose the comment before an entry that is deleted.
"""

from __future__ import annotations

import copy
import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from compd.documents.yaml_reader import Location, dotted, parse_yaml
from compd.errors import ConfigurationError

# A number, a vector, or a text.
Value: TypeAlias = float | Sequence[float] | str
# Texts without quotes; PyYAML adds them to words such as `yes`.
_PLAIN = re.compile(r"[A-Za-z_/][\w./-]*", re.ASCII)
# Longest line of an entry in block style.
_WIDTH = 110


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
            _add(cuts, text, parent, str(location[-1]), value, (remark, said) if remark else (), where)
        else:
            _replace(cuts, _child(parent, location[-1:], uses, where), value, where)
            cuts.remarks[text.count("\n", 0, _end(text, old))] += [said] * bool(said)
        _set(wanted, location, value)
    return _edited(text, path, cuts, wanted, remark)


def with_entries(text: str, path: Path, key: str, entries: Sequence[Any]) -> str:
    """The text with these entries in the list under `key`; entries that stay keep their text.

    key : of the top level; "" for a text that is the list itself. It is added where it is missing, and removed with
        its last entry. Comments in an entry that is replaced go above it.

    Raises ConfigurationError where the text is written so that its entries cannot be cut out.
    """
    data, _ = parse_yaml(text, path)
    wanted = {**(data or {}), key: list(entries)} if key else list(entries)
    if key and not entries:
        del wanted[key]  # type: ignore[arg-type]
    root, cuts = yaml.compose(text, Loader=yaml.SafeLoader), _Cuts()
    if root is None:
        return f"{text}{chr(10) * (text[-1:] not in ('', chr(10)))}{_block(wanted)}\n"
    found = ((name, value) for name, value in root.value if name.value == key) if key else ()
    name, node = next(iter(found), (None, None if key else root))
    if node is None:
        _add(cuts, text, root, key, list(entries), (), str(path))
    elif isinstance(root, yaml.MappingNode) and name is not None and not entries and not root.flow_style:
        cuts.parts.append((name.start_mark.index - name.start_mark.column, _line_end(text, _end(text, node)) + 1, ""))
    elif name is not None and isinstance(node, yaml.ScalarNode) and node.value in ("", "~", "null"):
        indent = " " * (name.start_mark.column + 2)
        cuts.parts.append((node.start_mark.index, node.end_mark.index, f"\n{_block(entries, indent)}"))
    elif isinstance(node, yaml.SequenceNode):
        _change_entries(cuts, text, node, data[key] if key else data, entries, str(path))
    else:
        raise _unusual(str(path))
    return _edited(text, path, cuts, wanted)


def _edited(text: str, path: Path, cuts: _Cuts, wanted: Any, remark: str = "") -> str:
    """The text with all parts put in. Raises ConfigurationError unless it has the data that are wanted."""
    edited = _cut(text, cuts, remark)
    try:
        data, _ = parse_yaml(edited, path)
    except ConfigurationError as error:
        raise _unusual(str(path)) from error
    if (data or None) != (wanted or None):
        raise _unusual(str(path))
    return edited


def _change_entries(
    cuts: _Cuts, text: str, node: yaml.SequenceNode, before: Sequence[Any], after: Sequence[Any], where: str
) -> None:
    """Make a list's entries those of `after`, each as one part; a list in one line is written anew around them."""
    steps = SequenceMatcher(None, list(map(repr, before)), list(map(repr, after)), autojunk=False).get_opcodes()
    if node.flow_style:
        if _comments(text[node.start_mark.index : node.end_mark.index]):
            raise _unusual(where)
        texts = [text[child.start_mark.index : child.end_mark.index] for child in node.value]
        kept = [texts[i1:i2] if tag == "equal" else map(_flow, after[j1:j2]) for tag, i1, i2, j1, j2 in steps]
        written = ", ".join(entry for part in kept for entry in part)
        cuts.parts.append((node.start_mark.index, node.end_mark.index, f"[{written}]"))
        return
    indent = " " * node.start_mark.column
    begins = [text.rfind(f"\n{indent}-", 0, child.start_mark.index) + 1 for child in node.value]
    ends = [_line_end(text, _end(text, child)) for child in node.value]
    for tag, i1, i2, j1, j2 in steps:
        both = 0 if tag == "equal" else min(i2 - i1, j2 - j1)
        for i, entry in zip(range(i1, i1 + both), after[j1:j2], strict=False):
            comments = "".join(f"{indent}{comment}\n" for comment in _comments(text[begins[i] : ends[i]]))
            cuts.parts.append((begins[i], ends[i], comments + _block([entry], indent)))
        if tag != "equal":
            cuts.parts += [(begins[i], ends[i] + 1, "") for i in range(i1 + both, i2)]
        if tag != "equal" and (added := after[j1 + both : j2]):
            at, new = (ends[i2 - 1], f"\n{_block(added, indent)}") if i2 else (begins[0], f"{_block(added, indent)}\n")
            cuts.parts.append((at, at, new))


def _comments(part: str) -> list[str]:
    """The comments in a part of a text."""
    begin, comments = 0, []
    for token in yaml.scan(part, Loader=yaml.SafeLoader):
        comments += re.findall(r"#[^\n]*", part[begin : token.start_mark.index])
        begin = token.end_mark.index
    return [*comments, *re.findall(r"#[^\n]*", part[begin:])]


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
        cuts.parts.append((node.start_mark.index, node.end_mark.index, _flow(value)))
        return
    children = node.value if isinstance(node, yaml.SequenceNode) else []
    if isinstance(value, float | int | str) or len(children) != len(value):
        raise _unusual(where)
    for child, number in zip(children, value, strict=True):
        _replace(cuts, child, number, where)


def _add(cuts: _Cuts, text: str, parent: yaml.Node, key: str, value: Any, comment: Sequence[str], where: str) -> None:
    """The key at the end of its mapping. comment : how it begins, and what it says; empty for none."""
    if not isinstance(parent, yaml.MappingNode) or not parent.value:
        raise _unusual(where)
    end = _end(text, parent.value[-1][1])
    line = text.count("\n", 0, end)
    if parent.flow_style:
        cuts.parts.append((end, end, f", {key}: {_flow(value)}"))
        cuts.remarks[line] += comment[1:]
    else:
        indent = " " * parent.value[0][0].start_mark.column
        entries = isinstance(value, list) and any(isinstance(entry, Mapping) for entry in value)
        entry = f"{key}:\n{_block(value, indent)}" if entries else f"{key}: {_flow(value)}"
        cuts.added.append((line, f"\n{indent}{entry}{'  # ' * bool(comment)}{' '.join(comment)}"))


class _Dumper(yaml.SafeDumper):
    """Texts in quotes except plain words, so that no YAML reader takes them for numbers; no anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = None if _PLAIN.fullmatch(text) else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


def _represent_number(dumper: yaml.SafeDumper, number: float) -> yaml.ScalarNode:
    """As many digits as it has, and 10 for 10.0."""
    whole = repr(float(number) + 0.0).removesuffix(".0")
    return dumper.represent_int(int(whole)) if whole.lstrip("-").isdigit() else dumper.represent_float(float(number))


_Dumper.add_representer(str, _represent_text)
_Dumper.add_multi_representer(float, _represent_number)
_Dumper.add_representer(float, _represent_number)


def _flow(value: Any) -> str:
    """A value as YAML in one line."""
    return yaml.dump(
        [value], Dumper=_Dumper, sort_keys=False, allow_unicode=True, default_flow_style=True, width=10**9
    )[1:-2]


def _block(data: Any, indent: str = "") -> str:
    """Entries as YAML, each from a line of its own, without the last line's end."""
    options: dict[str, Any] = {"sort_keys": False, "allow_unicode": True, "default_flow_style": None, "width": _WIDTH}
    return "\n".join(f"{indent}{line}" for line in yaml.dump(data, Dumper=_Dumper, **options).splitlines())


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


def _end(text: str, node: yaml.Node) -> int:
    """End of a node; a collection in block style ends with its last value, and not where the next one starts."""
    if isinstance(node, yaml.CollectionNode) and node.value and not node.flow_style:
        last = node.value[-1]
        return _end(text, last[1] if isinstance(last, tuple) else last)
    assert node.end_mark is not None
    return len(text[: node.end_mark.index].rstrip())


def _line_end(text: str, index: int) -> int:
    """Where the line ends that has this character."""
    end = text.find("\n", index)
    return len(text) if end < 0 else end


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
        "is written so that one part of it cannot be changed alone",
        allowed="numbers, vectors as [x, y, z], and a list with `- ` before each entry, without anchors",
        next_step="write it so, or change it in an editor",
    )
