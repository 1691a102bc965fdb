"""Drivers and their simulators, found by entry point or by path: there is no central list."""

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
_PATH = re.compile(r"^(?P<file>/.+\.py):(?P<name>[A-Za-z_]\w*)$")


def names(group: str) -> list[str]:
    """Names that installed packages offer in `group`, sorted."""
    return sorted({point.name for point in entry_points(group=group)})


def load(group: str, name: str, where: str) -> Any:
    """The class that `name` stands for: an entry point's name, or /absolute/file.py:ClassName.

    Raises PluginError, which names `where` and lists what there is.
    """
    if match := _PATH.match(name):
        return _load_file(Path(match["file"]), match["name"], where)
    points: dict[str, EntryPoint] = {point.name: point for point in entry_points(group=group)}
    if name not in points:
        raise PluginError(
            Problem(where, "no such driver", name, ", ".join(sorted(points)) or "none installed",
                    "choose one of these, or write /absolute/file.py:ClassName")
        )  # fmt: skip
    try:
        return points[name].load()
    except (ImportError, AttributeError, SyntaxError) as error:
        raise PluginError(
            Problem(where, f"{points[name].value} cannot be loaded: {error}", name,
                    next_step="reinstall the package that offers it")
        ) from error  # fmt: skip


def _load_file(file: Path, class_name: str, where: str) -> Any:
    """A class from a person's own file; a file that others may write could run anything as the daemon."""
    value = f"{file}:{class_name}"
    try:
        mode = file.stat().st_mode
    except OSError as error:
        raise PluginError(Problem(where, f"cannot read the driver's file: {error.strerror}", value)) from error
    if mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PluginError(
            Problem(where, "the driver's file may be written by group or others", value,
                    "mode 644 or stricter", f"chmod go-w {file}")
        )  # fmt: skip
    # one name per path: its classes look their own module up by it (pydantic resolves annotations there)
    module_name = "compd_file_" + re.sub(r"\W", "_", str(file))
    spec = importlib.util.spec_from_file_location(module_name, file)
    if spec is None or spec.loader is None:
        raise PluginError(Problem(where, "not a Python file", value))
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
        return getattr(module, class_name)
    except (ImportError, SyntaxError, AttributeError) as error:
        raise PluginError(Problem(where, f"the driver's file cannot be loaded: {error}", value)) from error
