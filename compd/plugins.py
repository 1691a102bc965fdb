"""Drivers, their simulators and effects, found by entry point or by path: there is no central list."""

from __future__ import annotations

import importlib.util
import re
import stat
import sys
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from compd.errors import PluginError, Problem

GAUGES = "compd.gauges"
SIMULATED_GAUGES = "compd.simulated_gauges"
EFFECTS = "compd.effects"
_KIND = {GAUGES: "driver", SIMULATED_GAUGES: "simulated device", EFFECTS: "effect"}
_PATH = re.compile(r"^(?P<file>/.+\.py):(?P<name>[A-Za-z_]\w*)$")


def names(group: str) -> list[str]:
    """Names that installed packages offer in `group`, sorted."""
    return sorted({point.name for point in entry_points(group=group)})


def load(group: str, name: str, where: str) -> Any:
    """What `name` stands for, a class or an effect: an entry point's name, or /absolute/file.py:Name.

    Raises PluginError, which names `where` and lists what there is.
    """
    if match := _PATH.match(name):
        return _load_file(Path(match["file"]), match["name"], where, _KIND.get(group, group))
    points: dict[str, EntryPoint] = {point.name: point for point in entry_points(group=group)}
    if name not in points:
        raise PluginError(
            Problem(
                where=where,
                what=f"no such {_KIND.get(group, group)}",
                value=name,
                allowed=", ".join(sorted(points)) or "none installed",
                next_step="choose one of these, or write /absolute/file.py:Name",
            )
        )
    try:
        return points[name].load()
    except (ImportError, AttributeError, SyntaxError) as error:
        raise PluginError(
            Problem(
                where=where,
                what=f"{points[name].value} cannot be loaded: {error}",
                value=name,
                next_step="reinstall the package that offers it",
            )
        ) from error


def _load_file(file: Path, name: str, where: str, kind: str) -> Any:
    """From a person's own file; a file that others may write could run anything as the daemon."""
    value = f"{file}:{name}"
    try:
        mode = file.stat().st_mode
    except OSError as error:
        raise PluginError(
            Problem(where=where, what=f"cannot read the {kind}'s file: {error.strerror}", value=value)
        ) from error
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PluginError(
            Problem(
                where=where,
                what=f"the {kind}'s file may be written by group or others",
                value=value,
                allowed="mode 644 or stricter",
                next_step=f"chmod go-w {file}",
            )
        )
    # one name per path: its classes look their own module up by it (pydantic resolves annotations there)
    module_name = "compd_file_" + re.sub(r"\W", "_", str(file))
    spec = importlib.util.spec_from_file_location(module_name, file)
    if spec is None or spec.loader is None:
        raise PluginError(Problem(where=where, what="not a Python file", value=value))
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
        return getattr(module, name)
    except (ImportError, SyntaxError, AttributeError) as error:
        raise PluginError(
            Problem(where=where, what=f"the {kind}'s file cannot be loaded: {error}", value=value)
        ) from error
