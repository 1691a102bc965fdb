"""What could be read of a configuration, section by section, for the checks across them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from compd.documents.document import Document
from compd.gauge import Gauge, GaugeOptions


@dataclass(frozen=True)
class Sections:
    """What could be read of a document, as `section.readable` gives it: None where something has a problem of its own.

    links : of the machine, 3 or 6. gauges : options by name, without the faulty ones. drivers : the gauges' driver
        classes by name.
    """

    document: Document
    links: int | None
    lines: Mapping[str, Any]
    gauges: Mapping[str, GaugeOptions]
    drivers: Mapping[str, type[Gauge[Any]]]
    wiring: Any
    acquisition: Any = None
    votes: Any = None
