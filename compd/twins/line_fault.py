"""Faults of simulated lines by their names: those that every line can have, and the check of a name."""

from __future__ import annotations

from collections.abc import Sequence

SILENT, UNPLUGGED = "silent", "unplugged"


def checked_fault(fault: str | None, faults: Sequence[str], kind: str) -> str | None:
    """The fault, None for none. Raises ValueError for one that a line of this `kind` cannot have."""
    if fault is not None and fault not in faults:
        raise ValueError(f"no fault {fault!r} on a line of kind {kind}: {', '.join(faults)}")
    return fault
