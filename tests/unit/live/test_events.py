"""The daemon's events: one list, to which every call in the code belongs, and the journal's entries made of them."""

from __future__ import annotations

import ast
import json
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from compd.live.system.events import EVENTS, KEYS, name_event
from compd.live.system.journal import RECORD_SEPARATOR, Journal, entry, text_of
from tests.support.paths import ROOT

LEVELS = ("debug", "info", "warning", "error", "exception")
LOGGERS = ("log", "_log", "log_change")


def logged() -> Iterator[tuple[str, str, str, set[str]]]:
    """Place, words, level and keys of every call of a logger in the daemon and its lines."""
    for path in sorted([*(ROOT / "compd" / "live").rglob("*.py"), *(ROOT / "compd" / "lines").rglob("*.py")]):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and node.args and _is_logger(node.func)):
                continue
            first = node.args[0]
            texts = [first.body, first.orelse] if isinstance(first, ast.IfExp) else [first]
            level = node.func.attr if isinstance(node.func, ast.Attribute) else ""
            for text in texts:
                assert isinstance(text, ast.Constant), f"{path}:{node.lineno}: an event's words are written out"
                keys = {keyword.arg for keyword in node.keywords if keyword.arg} - {"exc_info"}
                yield f"{path.relative_to(ROOT)}:{node.lineno}", str(text.value), level, keys


def _is_logger(function: ast.expr) -> bool:
    if isinstance(function, ast.Attribute):
        return isinstance(function.value, ast.Name) and function.value.id in LOGGERS and function.attr in LEVELS
    return isinstance(function, ast.Name) and function.id in LOGGERS


def test_every_event_of_the_daemon_is_in_the_list_with_its_keys() -> None:
    known = {event.text: event for event in EVENTS}
    unknown = [f"{place} {text!r}" for place, text, _, keys in logged() if text not in known]
    assert unknown == [], "add them to compd/live/system/events.py"
    extra = [
        f"{place} {keys - set(known[text].keys)}" for place, text, _, keys in logged() if keys - set(known[text].keys)
    ]
    assert extra == [], "name these keys in compd/live/system/events.py"


@pytest.mark.long
def test_the_list_has_nothing_that_does_not_come() -> None:
    said = {text for _, text, _, _ in logged()}
    assert {event.text for event in EVENTS} == said
    for event in EVENTS:
        keys = set().union(*(keys for _, text, _, keys in logged() if text == event.text))
        assert keys == set(event.keys), event.id
    assert {key for event in EVENTS for key in event.keys} == set(KEYS)


def test_names_are_unique_and_for_programs() -> None:
    assert len({event.id for event in EVENTS}) == len({event.text for event in EVENTS}) == len(EVENTS)
    assert all(event.id.isidentifier() and event.id.islower() for event in EVENTS)
    assert name_event(None, "", {"event": "line is lost"})["id"] == "line_lost"
    assert "id" not in name_event(None, "", {"event": "anything else"})


def fields(datagram: bytes) -> dict[str, str]:
    """What the journal reads from a datagram."""
    found = {}
    while datagram:
        name, equals, rest = datagram.partition(b"=")
        if b"\n" in name:
            name, _, rest = datagram.partition(b"\n")
            length = struct.unpack("<Q", rest[:8])[0]
            value, datagram = rest[8 : 8 + length], rest[8 + length + 1 :]
        else:
            assert equals
            value, _, datagram = rest.partition(b"\n")
        found[name.decode()] = value.decode()
    return found


LOST = {"event": "line is lost", "id": "line_lost", "level": "warning", "line": "scale_1", "detail": "gone\nfor good"}


def test_an_entry_has_a_field_for_every_key() -> None:
    assert fields(entry(LOST)) == {
        "MESSAGE": "line is lost: line=scale_1 detail=gone\nfor good",
        "PRIORITY": "4",
        "SYSLOG_IDENTIFIER": "compd",
        "COMPD_EVENT": "line_lost",
        "COMPD_LINE": "scale_1",
        "COMPD_DETAIL": "gone\nfor good",
    }


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    """The journal's end of its socket."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "journal"))
        listener.setblocking(False)
        yield listener


def test_an_event_of_another_process_becomes_an_entry_and_other_lines_stay_lines(
    tmp_path: Path, manager: socket.socket, capfd: pytest.CaptureFixture[str]
) -> None:
    here = Journal("not the standard error of this process", str(tmp_path / "journal"))
    here.msg(LOST)
    printed = capfd.readouterr().err
    assert printed.startswith(RECORD_SEPARATOR)
    assert json.loads(printed[1:]) == LOST
    here.write(printed)
    assert fields(manager.recv(65536))["COMPD_LINE"] == "scale_1"
    for line in ("a driver prints\n", printed[:20] + "\n"):
        here.write(line)
        assert capfd.readouterr().err == line
    with pytest.raises(BlockingIOError):
        manager.recv(1)


def test_an_entry_that_the_journal_does_not_take_is_printed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    Journal("", str(tmp_path / "nobody")).send(LOST)
    assert capfd.readouterr().err == text_of(LOST) + "\n"


def test_the_journal_is_used_only_where_standard_error_leads_to_it() -> None:
    assert Journal.from_environment({}) is None
    assert Journal.from_environment({"JOURNAL_STREAM": "1:2"}) is None
