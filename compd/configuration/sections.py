"""The readable parts of a configuration by section, for the checks across sections."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from compd.configuration.geometry import LINKS
from compd.documents import Document
from compd.gauge import Gauge, GaugeOptions
from compd.operation_settings import WIRES


@dataclass(frozen=True)
class Sections:
    """The readable parts of a document, from `section.readable`: None for a faulty section.

    links, scales : numbers of rods and of actuators. framed : whether the frame's reference points are stated. Each is
        None where it cannot be read.
    gauges : options by name, without the faulty ones. drivers : the gauges' driver classes by name.
    """

    document: Document
    links: int | None
    scales: int | None
    framed: bool | None
    lines: Mapping[str, Any]
    gauges: Mapping[str, GaugeOptions]
    drivers: Mapping[str, type[Gauge[Any]]]
    wiring: Any
    acquisition: Any = None
    votes: Any = None


def is_gauged(document: Document) -> bool:
    """Whether a document has a gauge, or a wire that needs one."""
    wiring = document.data.get("wiring")
    wires = wiring if isinstance(wiring, dict) else {}
    return document.data.get("gauges", {}) != {} or any(wires.get(kind) for kind in WIRES)


def count_of(geometry: Any, key: str) -> int | None:
    """Number of rods or actuators of a geometry, or of its readable part; None where it cannot be read."""
    kinematics, parts = getattr(geometry, "kinematics", None), getattr(geometry, key, None)
    return LINKS[kinematics] if kinematics is not None else len(parts) if parts else None


def is_framed(document: Document, geometry: Any) -> bool | None:
    """Whether the file states the frame's reference points; None where it has no geometry."""
    return None if geometry is None else document.value(("geometry", "plate_points_M_mm")) is not None
