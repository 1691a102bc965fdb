"""The page of the events that the daemon logs, from the list in the code."""

from __future__ import annotations

from compd.live.system.events import EVENTS, KEYS
from docs.generate.markdown import code, codes, escape, heading, join, sentence, table

INTRODUCTION = """\
The daemon logs one event for each change. On standard error an event is a line of `key=value` pairs; `id` is its name
for programs, `event` what people read:

    timestamp=... level=warning id=line_lost event="line is lost" line=scale_1 detail="..."

Under systemd each event is an entry of the journal with a field for each key, in capitals after `COMPD_`, and its name
in `COMPD_EVENT`. So a program follows what it is interested in:

    journalctl --unit compd COMPD_EVENT=line_lost COMPD_LINE=scale_1
    journalctl --unit compd --output json --follow COMPD_EVENT=state

Names and keys stay the same in later releases, which may add some; the words for people may change. The level is the
highest that the event comes with. Where lines could not be written as entries, as in a flood of more than 50 a second
from one process, they are counted in `log_dropped`.
"""


def page() -> str:
    """Markdown, from the list of events and that of their keys."""
    rows = [
        [code(e.id), e.level, codes(e.keys) or "-", f"*{escape(e.text)}*: {escape(sentence(e.meaning))}"]
        for e in EVENTS
    ]
    keys = [[code(key), escape(sentence(meaning))] for key, meaning in KEYS.items()]
    return join(
        "# Events",
        INTRODUCTION,
        table(["id", "level", "keys", "in words, and when"], rows),
        heading(2, "Keys", "events-keys"),
        table(["key", "meaning"], keys),
    )
