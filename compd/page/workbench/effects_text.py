"""The text of a file of effects, edited entry by entry; all other text stays unchanged.

The text is cut where the parser says that an entry begins and ends. A round trip through ruamel.yaml would write every
entry anew, with other indentation and line breaks, and lose the comment before an entry that is deleted.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from compd.documents import parse_yaml
from compd.errors import StateError
from compd.model.library import EFFECTS_FILE

_KEY = "effects"
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
# Style of a mapping written in one line.
_WIDTH = 110

Declaration = Mapping[str, Any]


class _QuotingDumper(yaml.SafeDumper):
    """Texts in quotes except plain words, so that no YAML reader takes them for numbers."""


def _represent_text(dumper: yaml.SafeDumper, text: str) -> yaml.ScalarNode:
    style = None if _PLAIN.fullmatch(text) else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_QuotingDumper.add_representer(str, _represent_text)


def entries_of(text: str, path: Path) -> list[Declaration]:
    """The effects declared by a text; none for comments alone.

    path : of the file, for messages. Raises ConfigurationError if it is no YAML.
    """
    data, _ = parse_yaml(text, path, EFFECTS_FILE)
    entries = data.get(_KEY, data) if isinstance(data, dict) else data
    if isinstance(entries, list):
        return entries
    return [] if entries is None else [entries]


def with_entry(text: str, declaration: Declaration, path: Path) -> str:
    """The text with this effect: replacing the one with its id, or at the end.

    Raises StateError if the text is written so that an entry cannot be added.
    """
    entries = entries_of(text, path)
    ids = [entry.get("id") for entry in entries]
    if declaration["id"] in ids:
        index = ids.index(declaration["id"])
        begin, end, indent = _span(text, index, path)
        comments = _comments(text[begin:end], indent)
        after = text[:begin] + comments + _written(declaration, indent) + text[end:]
        wanted = [*entries[:index], declaration, *entries[index + 1 :]]
    else:
        indent = _span(text, 0, path)[2] if entries else " " * 2 * text.rstrip().endswith(f"{_KEY}:")
        before = text if not text or text.endswith("\n") else f"{text}\n"
        after = f"{before}{_written(declaration, indent)}\n"
        wanted = [*entries, declaration]
    return _checked(after, wanted, path)


def without_entry(text: str, effect: str, path: Path) -> str:
    """The text without the effect of this id. Raises StateError if it is missing or cannot be cut out."""
    entries = entries_of(text, path)
    ids = [str(entry.get("id")) for entry in entries]
    if effect not in ids:
        raise StateError.of(str(path), "has no such effect", value=effect, allowed=", ".join(ids))
    index = ids.index(effect)
    begin, end, _ = _span(text, index, path)
    return _checked(text[:begin] + text[end + 1 :], [*entries[:index], *entries[index + 1 :]], path)


def _written(declaration: Declaration, indent: str) -> str:
    """An entry of a list, without the last line's end."""
    options: dict[str, Any] = {"sort_keys": False, "allow_unicode": True, "default_flow_style": None, "width": _WIDTH}
    lines = yaml.dump([dict(declaration)], Dumper=_QuotingDumper, **options).splitlines()
    return "\n".join(f"{indent}{line}" for line in lines)


def _checked(text: str, wanted: Sequence[Declaration], path: Path) -> str:
    """The text if it declares exactly these effects. Raises StateError otherwise."""
    if entries_of(text, path) != [dict(entry) for entry in wanted]:
        raise _by_hand(path)
    return text


def _span(text: str, index: int, path: Path) -> tuple[int, int, str]:
    """Start and end of an entry in the text (whole lines), and its indentation."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if isinstance(root, yaml.MappingNode):
        root = next((value for key, value in root.value if key.value == _KEY), root)
    if not isinstance(root, yaml.SequenceNode) or root.flow_style:
        raise _by_hand(path)
    node = root.value[index]
    dash = text.rfind("-", 0, node.start_mark.index)
    begin = text.rfind("\n", 0, dash) + 1
    last = len(text[: _end(node)].rstrip())
    end = text.find("\n", last)
    return begin, len(text) if end < 0 else end, text[begin:dash]


def _end(node: yaml.Node) -> int:
    """End of a node; a collection in block style ends at the start of the next one."""
    if isinstance(node, yaml.CollectionNode) and node.value and not node.flow_style:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    assert node.end_mark is not None
    return node.end_mark.index


def _comments(entry: str, indent: str) -> str:
    """The comments in an entry, each in a line of its own."""
    ends = [0]
    comments: list[str] = []
    for token in yaml.scan(entry, Loader=yaml.SafeLoader):
        comments += re.findall(r"#[^\n]*", entry[ends[-1] : token.start_mark.index])
        ends.append(token.end_mark.index)
    return "".join(f"{indent}{comment}\n" for comment in [*comments, *re.findall(r"#[^\n]*", entry[ends[-1] :])])


def _by_hand(path: Path) -> StateError:
    return StateError.of(
        str(path),
        "is written so that the page cannot change one entry alone",
        allowed="a list, `- id: ...` for each effect, without anchors",
        next_step="write it so, or change it in an editor",
    )
