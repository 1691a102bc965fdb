"""The configurations that come with compd, in the checkout or inside the installed package."""

from __future__ import annotations

from pathlib import Path

from compd.errors import CompdError, Problem

_PLACES = (Path(__file__).parents[1] / "shipped_config", Path(__file__).parents[2] / "config")


def shipped_configuration(name: str) -> Path:
    """The path of a shipped configuration, e.g. "tripod-cmm.yaml"; CompdError when the installation lacks it."""
    for place in _PLACES:
        if (place / name).is_file():
            return place / name
    raise CompdError(
        Problem(
            where=str(_PLACES[0]),
            what="the shipped configurations are missing",
            value=name,
            next_step="reinstall compd",
        )
    )
