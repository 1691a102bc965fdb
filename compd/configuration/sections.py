"""The readable parts of a configuration by section, for the checks across sections."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from compd.documents import Document
from compd.gauge import Gauge, GaugeOptions


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
