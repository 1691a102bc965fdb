"""What the page makes of a daemon that refuses, or tells what nobody understands: it says so, and tries again."""

from __future__ import annotations

import asyncio
import json

import pytest

from compd.page.daemon_link import DaemonLink
from tests.support.patience import PATIENCE_S

VERSION = {"class": "VERSION"}


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        ([{"class": "ERROR", "code": "too_many", "text": "16 clients are connected"}], "16 clients are connected"),
        ([VERSION, {"class": "ERROR", "code": "unknown_class", "text": "MACHINE: not known"}], "MACHINE: not known"),
        ([VERSION, {"class": "MACHINE"}], "does not understand"),
        ([{"class": "VERSION"}, []], "does not understand"),
        (["no JSON"], "line 1"),
        ([], "closed the connection"),
    ],
)
def test_the_reason_is_told_and_the_link_goes_on(tmp_path, lines, reason):
    """Each connection gets the same lines: the greeting, then the answer to whatever is asked first."""
    connections = []

    async def talk(reader, writer):
        connections.append(writer)
        for k, line in enumerate(lines):
            if k:
                await reader.readline()
            writer.write((line if isinstance(line, str) else json.dumps(line)).encode() + b"\n")
        if lines:
            await reader.read()
        writer.close()

    async def conversation():
        path = str(tmp_path / "s")
        link = DaemonLink(path)
        async with asyncio.timeout(PATIENCE_S), await asyncio.start_unix_server(talk, path):
            running = asyncio.create_task(link.run())
            async with link.news:
                for _ in range(2):
                    await link.news.wait()
                    assert not link.connected
                    assert reason in link.reason
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    asyncio.run(conversation())
    assert len(connections) >= 2
