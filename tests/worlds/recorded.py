"""Nothing recorded is lost: every row that was sent is on the disk, loads, and replays to the last bit."""

from __future__ import annotations

import json

from compd.configuration import Configuration
from compd.errors import CompdError
from compd.live.record import Agreement, RecordedCycles, replay_cycles
from compd.recording import read_recording
from tests.worlds.clients import Recording


def recorded(recording: Recording, configuration: Configuration) -> str:
    """What is wrong with a recording that has ended; "" where nothing is.

    A disk without room ends it. Then what was written before is whole.
    """
    if not recording.done:
        return "the recorder has not ended"
    return _rows(recording) or _loads(recording, configuration) or _replays(recording, configuration)


def _rows(recording: Recording) -> str:
    sent = [line for line in recording.received if b'"zero":' in line]
    kept = [
        line
        for path in RecordedCycles(recording.name).paths
        for line in path.read_bytes().splitlines(keepends=True)
        if line.startswith(b'{"class":"READINGS"')
    ]
    if kept == sent or (recording.failure and kept == sent[: len(kept)]):
        return ""
    lost = [json.loads(line)["seq"] for line in sent if line not in set(kept)]
    return f"{len(sent)} rows came and {len(kept)} are on the disk; lost cycles {lost[:5]}; {recording.summary}"


def _loads(recording: Recording, configuration: Configuration) -> str:
    cycles = RecordedCycles(recording.name)
    if lacking := cycles.rows_without_cycle():
        return f"rows without a cycle: {lacking}"
    try:
        for path in cycles.paths:
            table = path.with_name(path.name.replace(".cycles.jsonl", ".csv"))
            read_recording(table, configuration, needs_reference=False)
    except CompdError as error:
        return f"does not load: {error}"
    return "" if cycles.torn_lines == 0 else f"{cycles.torn_lines} torn lines"


def _replays(recording: Recording, configuration: Configuration) -> str:
    try:
        for cycle in replay_cycles(configuration, RecordedCycles(recording.name)):
            if cycle.agreement is not Agreement.SAME:
                return f"{cycle.where}: {cycle.agreement}"
    except CompdError as error:
        return f"does not replay: {error}"
    return ""
