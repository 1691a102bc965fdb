"""Loading a machine's configuration: the Configuration, or every problem in its file at once."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from pydantic import Field, ValidationError

from compd.configuration import crosscheck
from compd.configuration.effect_files import EffectFile, EffectFiles
from compd.configuration.external_geometry import EXTERNAL, ExternalGeometry, external_of
from compd.configuration.geometry import Geometry
from compd.configuration.geometry_checks import contradictions
from compd.configuration.hashes import NOT_IN_ZERO, hash_of
from compd.configuration.plausible import implausible
from compd.configuration.sections import Sections, count_of, is_framed, is_gauged
from compd.documents import (
    Document,
    Location,
    Text,
    read_document,
    readable,
    unknown_key,
    validate,
    validation_problems,
    value_text,
)
from compd.errors import ConfigurationError, PluginError, Problem
from compd.gauge import Gauge, GaugeOptions
from compd.line_settings import LineSettings
from compd.lines import LINES_BY_NAME
from compd.operation_settings import (
    AcquisitionSettings,
    LimitSettings,
    LoopSettings,
    SocketSettings,
    StateSettings,
    VoteSettings,
    Wiring,
)
from compd.plugins import GAUGES
from compd.plugins import load as load_plugin
from compd.result_tables import Columns, data_frame, html_table
from compd.stated_noise import StatedNoise, stated_noise

if TYPE_CHECKING:
    import pandas as pd

SECTIONS: Mapping[str, Any] = {
    "machine": Annotated[
        Text,
        Field(
            description="the machine's name, which recordings and model files repeat; `external`: own kinematics or a "
            "client gives the pose, and `geometry` has other keys"
        ),
    ],
    "geometry": Geometry,
    "lines": Annotated[
        LINES_BY_NAME, Field(description="The lines (ports), by name; each is polled by a thread of its own.")
    ],
    "wiring": Wiring,
    "loop": LoopSettings,
    "acquisition": AcquisitionSettings,
    "votes": VoteSettings,
    "limits": LimitSettings,
    "sockets": SocketSettings,
    "state": StateSettings,
    "effects": EffectFiles,
}
# Sections that have other keys with `machine: external`.
EXTERNAL_SECTIONS: Mapping[str, Any] = {"geometry": ExternalGeometry}
# Defaults of omitted sections.
OPTIONAL_SECTIONS: Mapping[str, Any] = {"acquisition": AcquisitionSettings(), "votes": VoteSettings(), "effects": ()}
# Sections that a machine without any gauge leaves out, as `gauges`.
GAUGE_SECTIONS: Mapping[str, Any] = {"lines": {}, "wiring": Wiring()}


@dataclass(frozen=True, repr=False)
class Configuration:
    """A whole, checked machine, as returned by `load_machine`.

    Attributes
    ----------
    path : Path
        The file (YAML).
    machine : str
        Name of the machine.
    geometry : Geometry
        Joints, tool and plate; lengths in mm, angles in rad, the frame in every name. With ``machine: external``
        an `ExternalGeometry`.
    lines : dict
        Settings of each line (serial port, Modbus), by name.
    gauges : dict
        Options of each gauge, of its driver's own model, by name.
    drivers : dict
        Driver class of each gauge, by name.
    wiring : Wiring
        Which gauge measures which quantity of the machine.
    loop : LoopSettings
        Rate of the daemon's loop, and what it does when a reading is stale.
    limits : LimitSettings
        Largest corrections.
    sockets : SocketSettings
        Where clients connect.
    state : StateSettings
        What the daemon keeps across restarts.
    acquisition : AcquisitionSettings
        Which lines are polled in processes of their own.
    votes : VoteSettings
        What the gauges say of each other.
    effects : tuple of EffectFile
        Python files whose effects the daemon may compute, each with its hash.
    warnings : tuple of Problem
        What can be used but is probably a mistake or a risk.
    document : Document or None
        The file's data with the line of every key.
    """

    path: Path
    machine: str
    geometry: Geometry
    lines: Mapping[str, LineSettings]
    gauges: Mapping[str, GaugeOptions]
    drivers: Mapping[str, type[Gauge[Any]]]
    wiring: Wiring
    loop: LoopSettings
    limits: LimitSettings
    sockets: SocketSettings
    state: StateSettings
    acquisition: AcquisitionSettings = OPTIONAL_SECTIONS["acquisition"]
    votes: VoteSettings = OPTIONAL_SECTIONS["votes"]
    effects: tuple[EffectFile, ...] = ()
    warnings: tuple[Problem, ...] = ()
    document: Document | None = field(default=None, compare=False)

    @property
    def external(self) -> ExternalGeometry | None:
        """Who gives the pose with ``machine: external``; None for any other machine."""
        return external_of(self.geometry)

    def where(self, *location: str | int) -> str:
        """`file:line key.path` of a key, for a problem: where("limits", "correction_mm")."""
        document = self.document or Document(self.path, {}, {})
        return document.where(location)

    def gauge_objects(self) -> dict[str, Gauge[Any]]:
        """A fresh driver object for every gauge."""
        return {name: self.drivers[name](options) for name, options in self.gauges.items()}

    def noise_of(self, gauge: str) -> StatedNoise:
        """Noise of a gauge's lengths. gauge : its name, or that of one of its channels."""
        name = gauge.split(".", maxsplit=1)[0]
        return stated_noise(self.gauges[name], self.drivers[name])

    def to_dataframe(self) -> pd.DataFrame:
        """One row per wired channel, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            `column`, as a recording names the channel, with its unit; `gauge`, with the channel after a dot where
            the gauge has several; `driver` and `line` of the gauge; `link`, nan where it belongs to none; `sign`,
            +1 or -1; `noise_um`, standard deviation of one reading of a length, nan where neither the configuration
            nor the driver states it.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        return data_frame(self._columns())

    def _repr_html_(self) -> str:
        return html_table(str(self), self._columns(), [str(warning) for warning in self.warnings])

    def __str__(self) -> str:
        return (
            f"{self.machine}: {self._kind}, {self.geometry.links} links, "
            f"{len(self.gauges)} gauges on {len(self.lines)} lines"
        )

    @property
    def _kind(self) -> str:
        external = self.external
        return self.geometry.kinematics or "parallel" if external is None else external.kinematics

    def __repr__(self) -> str:
        return f"<Configuration {self}>"

    def _columns(self) -> Columns:
        wiring = self.wiring
        wires: list[tuple[str, str, float, int]] = [
            *((f"scale_{wire.link}_mm", wire.gauge, wire.link, wire.sign) for wire in wiring.scale),
            *((f"joint_{k}_um", wire.gauge, wire.link, wire.sign) for k, wire in enumerate(wiring.joint, start=1)),
            *((f"frame_{wire.distance}_um", wire.gauge, math.nan, wire.sign) for wire in wiring.frame),
            *((wire.name, wire.gauge, math.nan, 1) for wire in wiring.quantities),
        ]
        options = [self.gauges[gauge.split(".")[0]] for _, gauge, _, _ in wires]
        lengths = [column.endswith(("_mm", "_um")) for column, _, _, _ in wires]
        return {
            "column": [column for column, _, _, _ in wires],
            "gauge": [gauge for _, gauge, _, _ in wires],
            "driver": [option.driver for option in options],
            "line": [option.line for option in options],
            "link": [link for _, _, link, _ in wires],
            "sign": [sign for _, _, _, sign in wires],
            "noise_um": [
                self.noise_of(gauge).um if length else math.nan
                for (_, gauge, _, _), length in zip(wires, lengths, strict=True)
            ],
        }

    @property
    def config_hash(self) -> str:
        """Hash of everything in the file, equal for two daemons with the same configuration."""
        fields = ("machine", "geometry", "lines", "gauges", "wiring", "loop", "limits", "sockets", "state")
        # an optional section without settings changes no hash: recordings and controllers know those of older releases
        said = tuple(name for name, default in OPTIONAL_SECTIONS.items() if getattr(self, name) != default)
        return hash_of(self, (*fields, *said))

    @property
    def geometry_hash(self) -> str:
        """Hash of the basis of a model: the geometry without the limits of the links' length and its tolerance."""
        return hash_of(self, ("geometry",), without=("link_length_mm", "tolerance_mm"))

    @property
    def zero_hash(self) -> str:
        """Hash of the basis of machine zero: geometry, gauges and wiring without ports, rates, limits and noise."""
        return hash_of(self, ("machine", "geometry", "gauges", "wiring"), without=NOT_IN_ZERO)


class Examined(NamedTuple):
    """The readable part of a file: its problems, and the configuration if there are none.

    geometry, wiring : None if they have a problem.
    """

    document: Document
    configuration: Configuration | None
    problems: list[Problem]
    warnings: list[Problem]
    geometry: Geometry | None
    wiring: Wiring | None


def is_external(document: Document) -> bool:
    """Whether a document is of `machine: external`."""
    return bool(document.data.get("machine") == EXTERNAL)


def sections_of(document: Document) -> Mapping[str, Any]:
    """What each section of a document is read as."""
    return {**SECTIONS, **EXTERNAL_SECTIONS} if is_external(document) else SECTIONS


def load(path: Path) -> Configuration:
    """Read and check a configuration.

    Raises ConfigurationError with every problem: file, line, key, value, what is allowed, next step.
    """
    examined = examine(path)
    if examined.configuration is None:
        raise ConfigurationError(in_order(examined.problems))
    return examined.configuration


def in_order(problems: Sequence[Problem]) -> list[Problem]:
    """Each problem once, in the order of the file."""
    return sorted(dict.fromkeys(problems), key=lambda problem: _line_number(problem.where))


def examine(path: Path) -> Examined:
    """Read a configuration as far as possible, with every check on its readable parts.

    Raises ConfigurationError if the file as a whole cannot be read.
    """
    document = read_document(path)
    problems: list[Problem] = []
    section_names = [*SECTIONS, "gauges"]
    problems += [unknown_key(document, (key,), section_names) for key in document.data if key not in section_names]
    sections: dict[str, Any] = {}
    kinds = sections_of(document)
    defaults = {**OPTIONAL_SECTIONS, **({} if (gauged := is_gauged(document)) else GAUGE_SECTIONS)}
    for name, kind in kinds.items():
        if name in document.data:
            sections[name] = validate(kind, document, (name,), problems)
        elif name in defaults:
            sections[name] = defaults[name]
        else:
            sections[name] = None
            problems.append(Problem(str(path), f"section `{name}` is missing", next_step=f"add `{name}:`"))
    gauges, drivers = gauges_of(document, problems) if gauged else ({}, {})
    part = {
        name: sections[name] if sections[name] is not None else readable(kind, document.value((name,)))
        for name, kind in kinds.items()
    }
    problems += [
        Problem(document.where(("geometry", *location)), what, value=value, allowed=allowed, next_step=step)
        for location, what, value, allowed, step in (() if is_external(document) else contradictions(part["geometry"]))
    ]
    checked = Sections(
        document,
        0 if is_external(document) else count_of(part["geometry"], "rods"),
        getattr(part["geometry"], "links", None) if is_external(document) else count_of(part["geometry"], "actuators"),
        is_framed(document, part["geometry"]),
        part["lines"] or {},
        gauges,
        drivers,
        part["wiring"],
        part["acquisition"],
        part["votes"],
    )
    problems += crosscheck.problems(checked)
    warnings = in_order([*crosscheck.warnings(checked), *implausible(document, part, gauges)])
    configuration = None
    if not problems:
        configuration = Configuration(
            path, gauges=gauges, drivers=drivers, warnings=tuple(warnings), document=document, **sections
        )
    return Examined(document, configuration, problems, warnings, sections["geometry"], sections["wiring"])


def gauges_of(
    document: Document, problems: list[Problem]
) -> tuple[dict[str, GaugeOptions], dict[str, type[Gauge[Any]]]]:
    """Each gauge's options, checked by its driver's model, and its driver; notes the problems of faulty ones.

    A gauge with faulty options is not among the options.
    """
    gauges: dict[str, GaugeOptions] = {}
    drivers: dict[str, type[Gauge[Any]]] = {}
    section = document.data.get("gauges")
    if not isinstance(section, dict) or not section:
        problems.append(
            Problem(
                document.where(("gauges",)),
                "section `gauges` is missing or empty",
                next_step="add `gauges:` with one entry per device; without any, leave all wires out, too",
            )
        )
        return gauges, drivers
    for name, raw in section.items():
        location: Location = ("gauges", name)
        if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z0-9_]+", name):
            problems.append(
                Problem(
                    document.where(location),
                    "cannot be a gauge's name",
                    value=repr(name),
                    allowed="letters, digits and _",
                    next_step="rename it, under `wiring:` too; in quotes if it has digits only",
                )
            )
            continue
        if not isinstance(raw, dict) or not isinstance(raw.get("driver"), str):
            problems.append(
                Problem(
                    document.where(location),
                    "needs `driver:`",
                    value=value_text(raw.get("driver", "") if isinstance(raw, dict) else raw, location),
                    next_step="`compd gauge list` lists them",
                )
            )
            continue
        try:
            driver = drivers[name] = load_plugin(GAUGES, raw["driver"], document.where((*location, "driver")))
            options = driver.Options.model_validate(raw)
        except PluginError as error:
            problems += error.problems
        except ValidationError as error:
            problems += validation_problems(error, document, location, driver.Options)
        else:
            if (why := _why_not_made(driver, options)) is None:
                gauges[name] = options
            else:
                problems.append(Problem(document.where(location), why, next_step="mend the driver"))
    return gauges, drivers


def _why_not_made(driver: type[Gauge[Any]], options: GaugeOptions) -> str | None:
    """Reason why a driver, possibly faulty itself, cannot be created with these options; None if it can."""
    try:
        channels = [(channel.name, channel.unit) for channel in driver(options).channels]
    except Exception as error:  # noqa: BLE001
        return f"the driver fails with these options: {type(error).__name__}: {error}"
    names = [name for name, _ in channels]
    if not names or len(set(names)) < len(names):
        return f"the driver has {'two channels of one name' if names else 'no channels'}"
    return None


def _line_number(where: str) -> int:
    """The line in "file:line key.path"; 0 without one, so that problems of the whole file come first."""
    found = re.search(r":(\d+)(?: |$)", where)
    return int(found[1]) if found else 0
