"""How much memory a process may take beyond what it has."""

from __future__ import annotations

import resource
from pathlib import Path

_BYTES_PER_MB = 1_000_000


def limit_memory(memory_mb: float) -> None:
    """Let the process grow by so much (MB) from what it has now; beyond, it gets a MemoryError."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    now_kb = next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmData"))
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    limit = now_kb * 1024 + int(memory_mb * _BYTES_PER_MB)
    resource.setrlimit(resource.RLIMIT_DATA, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))
