"""Recordings of this machine: the files in a directory, and `compd recording start` controlled from the page."""

from __future__ import annotations

import asyncio
import re
import shlex
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from compd.live.record import CYCLES_SUFFIX, MODEL_MARK
from compd.page.downloads import zipped
from compd.recording import ARROW
from compd.table_file import SUFFIXES

# Name of a recording: letters and digits, a valid file name on every system, never a path.
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")
# Further files of a recording, downloaded with its table besides `CYCLES_SUFFIX` and copies of models.
SIDECAR = ".yaml"
_END_WITHIN_S = 10.0


@dataclass
class Running:
    """A running `compd recording start`. started_s : Unix time."""

    name: str
    command: str
    started_s: float
    process: asyncio.subprocess.Process


class Recordings:
    """The recordings in `directory`; used by the event loop's thread alone."""

    def __init__(self, directory: Path, socket: str) -> None:
        self.directory = directory
        self._socket = socket
        self.running: Running | None = None
        self.last_words = ""
        self._starting = asyncio.Lock()  # two browsers may start one at once

    def listed(self) -> list[dict[str, Any]]:
        """Every part of every recording, the newest first."""
        parts = []
        for path in recording_tables(self.directory).values():
            try:
                stat = path.stat()
            except FileNotFoundError:  # removed meanwhile
                continue
            parts.append(
                {
                    "name": path.stem,
                    "bytes": stat.st_size,
                    "changed": datetime.fromtimestamp(stat.st_mtime, UTC).isoformat(timespec="seconds"),
                    "sidecar": path.with_suffix(SIDECAR).is_file(),
                    "command": f"cp {shlex.quote(str(path.with_suffix('')))}.* .",
                }
            )
        return sorted(parts, key=lambda part: str(part["changed"]), reverse=True)

    def command(self, name: str, burst_s: float | None) -> list[str]:
        """The command line that records."""
        words = ["compd", "recording", "start", str(self.directory / name), "--daemon", self._socket]
        return words if burst_s is None else [*words, "--burst", f"{burst_s:g}"]

    async def start(self, name: str, burst_s: float | None) -> str:
        """Start recording; return the reason of a failure, or ""."""
        if not NAME.fullmatch(name):
            return "a name has letters, digits, - and _, at most 64 of them"
        async with self._starting:
            return await self._start(name, burst_s)

    async def _start(self, name: str, burst_s: float | None) -> str:
        if self.running is not None:
            return f"{self.running.name} is being recorded already"
        if any(any(self.directory.glob(f"{name}-*{suffix}")) for suffix in (*SUFFIXES, ARROW)):
            return f"{name} is there already"
        self.directory.mkdir(parents=True, exist_ok=True)
        words = self.command(name, burst_s)
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-P",  # keeps the working directory out of the import path
            "-m",
            *words,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
        now_s = datetime.now(UTC).timestamp()
        self.running, self.last_words = Running(name, shlex.join(words), now_s, process), ""
        self._watching = asyncio.create_task(self._watch(self.running))
        return ""

    async def stop(self) -> None:
        """End the recording as Ctrl-C does, and wait until its files are complete."""
        if (running := self.running) is not None:
            running.process.send_signal(signal.SIGINT)
            async with asyncio.timeout(_END_WITHIN_S):
                await self._watching

    def archive(self, name: str) -> Iterator[bytes] | None:
        """A part with its sidecar and the files of a replay, as pieces of a zip file; None for an unknown part."""
        paths = self._files_of(name)
        return zipped(paths) if paths else None

    def _files_of(self, name: str) -> Sequence[Path]:
        if not NAME.fullmatch(name) or name not in recording_tables(self.directory):
            return []
        named = [self.directory / f"{name}{ending}" for ending in (*SUFFIXES, SIDECAR, CYCLES_SUFFIX)]
        models = self.directory.glob(f"{name}{MODEL_MARK}*{SIDECAR}")
        return sorted(filter(is_own, [*named, *models]))

    async def _watch(self, running: Running) -> None:
        _, errors = await running.process.communicate()
        if running.process.returncode:
            self.last_words = errors.decode(errors="replace").strip()[-500:]
        self.running = None


def recording_tables(directory: Path) -> dict[str, Path]:
    """Name -> table of every recording in the directory; CSV takes precedence over Parquet of the same name."""
    paths = [path for suffix in reversed(SUFFIXES) for path in directory.glob(f"*{suffix}") if is_own(path)]
    return {path.stem: path for path in paths}


def is_own(path: Path) -> bool:
    """Whether it is a regular file of the directory, since a link may lead anywhere."""
    return path.is_file() and not path.is_symlink()
