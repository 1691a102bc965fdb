"""A contradiction in the geometry of a configuration."""

from __future__ import annotations

from typing import NamedTuple

from compd.documents import Location


class GeometryProblem(NamedTuple):
    """A contradiction in a geometry. location : below `geometry`."""

    location: Location
    what: str
    value: str = ""
    allowed: str = ""
    next_step: str = ""
