"""Memory, threads and descriptors of the daemon's processes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

# What the interpreter and its allocator may keep of a fault's busiest moment.
GROWTH_MB = 25.0
# A line that is being opened, a client that has just closed.
MORE_DESCRIPTORS = 8


@dataclass(frozen=True)
class Resources:
    """Of one process."""

    memory_mb: float
    threads: int
    descriptors: int

    def growth_since(self, before: Resources) -> str:
        """What has grown beyond what it may; "" for nothing."""
        grown = []
        if self.memory_mb > before.memory_mb + GROWTH_MB:
            grown.append(f"memory {before.memory_mb:.0f} to {self.memory_mb:.0f} MB")
        if self.threads > before.threads:
            grown.append(f"threads {before.threads} to {self.threads}")
        if self.descriptors > before.descriptors + MORE_DESCRIPTORS:
            grown.append(f"descriptors {before.descriptors} to {self.descriptors}")
        return ", ".join(grown)


def resources_of(pid: int) -> Resources:
    """Of a process that runs."""
    folder = Path(f"/proc/{pid}")
    text = (folder / "status").read_text()
    resident_kb, threads = (int(found) for found in re.findall(r"^(?:VmRSS|Threads):\s+(\d+)", text, re.MULTILINE))
    return Resources(resident_kb / 1e3, threads, len(list((folder / "fd").iterdir())))


def resources_by_process(pids: dict[str, int]) -> dict[str, Resources]:
    return {name: resources_of(pid) for name, pid in pids.items()}
