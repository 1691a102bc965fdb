"""A machine's configuration by its path, or by the name of a shipped one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TypeAlias

from compd.configuration.machine_configuration import Configuration, load
from compd.errors import CompdError, ConfigurationError

# Directories in the installed package, and in a checkout.
_PLACES = (Path(__file__).parents[1] / "shipped_config", Path(__file__).parents[2] / "config")
# A configuration, its path, or the name of one that comes with compd.
Machine: TypeAlias = Configuration | str | Path


def load_machine(machine: Machine) -> Configuration:
    """Load and check the configuration of a machine.

    Parameters
    ----------
    machine : str, Path or Configuration
        The path of a configuration (YAML); or the name of one that comes with compd, such as ``"tripod-cmm"``. A text
        with a ``/`` or with the suffix ``.yaml`` or ``.yml`` is a path, any other a name. A configuration that is
        loaded already is returned as it is.

    Returns
    -------
    Configuration
        The whole machine: geometry (lengths in mm, angles in rad), lines, gauges, wiring, limits, sockets.

    Raises
    ------
    ConfigurationError
        With every problem of the file at once, each with file, line, key, value, what is allowed and what to do;
        or where no configuration of that name comes with compd.

    Examples
    --------
    >>> import compd
    >>> compd.load_machine("tripod-cmm").geometry.links
    3
    """
    if isinstance(machine, Configuration):
        return machine
    if isinstance(machine, Path) or "/" in machine or machine.endswith((".yaml", ".yml")):
        return load(Path(machine))
    if machine not in shipped_names():
        raise ConfigurationError.of(
            "machine",
            "no configuration of this name comes with compd",
            value=machine,
            allowed=", ".join(shipped_names()),
            next_step="choose one of these, or give the path of your machine's configuration (NAME.yaml)",
        )
    return load(shipped_configuration(f"{machine}.yaml"))


def shipped_names() -> list[str]:
    """Names of the machines whose configurations come with compd."""
    return sorted(
        {path.stem for place in _PLACES for path in place.glob("*.yaml") if re.fullmatch(r"[\w-]+", path.stem)}
    )


def shipped_effects() -> dict[str, Path]:
    """The files of effects that come with compd for kinds of machines, by name, such as "telescope"."""
    return {path.stem: path for place in reversed(_PLACES) for path in sorted((place / "effects").glob("*.yaml"))}


def shipped_configuration(name: str) -> Path:
    """The path of a shipped configuration, e.g. "tripod-cmm.yaml"; CompdError when the installation lacks it."""
    for place in _PLACES:
        if (place / name).is_file():
            return place / name
    raise CompdError.of(
        str(_PLACES[0]), "the shipped configurations are missing", value=name, next_step="reinstall compd"
    )
