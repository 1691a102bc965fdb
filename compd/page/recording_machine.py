"""The configuration for reading a recording: the page's own if it describes the recording's machine."""

from __future__ import annotations

from pathlib import Path

from compd.configuration import load_machine
from compd.recording import read_sidecar


def machine_of(recording: Path, machine: Path | None) -> Path | None:
    """`machine` if the recording is of it; None for the shipped one that the recording names."""
    if machine is None:
        return None
    sidecar = read_sidecar(recording.with_suffix(".yaml"), [])
    return machine if sidecar is not None and load_machine(machine).machine == sidecar.machine else None
