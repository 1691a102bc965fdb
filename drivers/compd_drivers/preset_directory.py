"""A folder of presets: every `NAME.yaml` in it is a gauge driver NAME with its simulated device.

A package offers its folder in the entry-point group `compd.gauge_presets`:

    [project.entry-points."compd.gauge_presets"]
    my_package = "my_package.presets:directory"         # directory = PresetDirectory(files("my_package.presets"))
"""

from __future__ import annotations

import math
from functools import cache
from importlib.resources import as_file
from importlib.resources.abc import Traversable
from typing import Any

from pydantic import BaseModel, ValidationError

from compd.documents import Document, Location, read_document
from compd.errors import ConfigurationError, PluginError, Problem
from compd.files import FileKind
from compd.gauge import Gauge
from compd.plugins import GAUGES, SIMULATED_GAUGES, load
from compd_drivers.preset import Preset

SUFFIX = ".yaml"
PRESET = FileKind(
    "a preset",
    frozenset({"title", "delivers", "source", "base", "gauge"}),
    least=2,
    others=frozenset(Preset.model_fields),
    next_step="drivers/compd_drivers/presets/README.md says what a preset may hold",
)
WORDS = {"missing": "is missing", "extra_forbidden": "unknown key"}


class PresetDirectory:
    """The presets in one folder. Each file is read when its preset is first used."""

    def __init__(self, folder: Traversable) -> None:
        self._folder = folder
        self.driver = cache(self._driver)
        self.simulated_device = cache(self._simulated_device)

    def names(self) -> list[str]:
        """Names of all presets, sorted."""
        return sorted(file.name.removesuffix(SUFFIX) for file in self._folder.iterdir() if file.name.endswith(SUFFIX))

    def read(self, name: str) -> tuple[Preset, Document]:
        """A preset and the file that it was read from. Raises PluginError, with every problem and its line."""
        if name not in self.names():
            raise PluginError.of(str(self._folder), "no such preset", value=name, allowed=", ".join(self.names()))
        try:
            with as_file(self._folder / f"{name}{SUFFIX}") as path:
                document = read_document(path, PRESET)
            return Preset.model_validate(document.data), document
        except ConfigurationError as error:
            raise PluginError(error.problems) from error
        except ValidationError as error:
            raise PluginError(_problems(document, error)) from error

    def _driver(self, name: str) -> type[Gauge[Any]]:
        """The driver's class. Raises PluginError, with every problem and its line, for a file that cannot be used."""
        preset, document = self.read(name)
        base = load(GAUGES, preset.base, document.where(("base",)))
        try:
            return driver_class(name, preset, base)
        except ValidationError as error:
            raise PluginError(_problems(document, error, ("sample",))) from error
        except ValueError as error:
            raise PluginError.of(document.where(("options",)), str(error)) from error

    def _simulated_device(self, name: str) -> type:
        """The simulated device's class: that of the base driver, with this description. Errors as for the driver."""
        preset, document = self.read(name)
        base = load(GAUGES, preset.base, document.where(("base",)))
        device = load(SIMULATED_GAUGES, preset.base, document.where(("base",)))
        sample = self.driver(name).Options.model_validate({"driver": name, "line": "line", **preset.sample})
        try:
            preset.simulated_options(sample, base.Options)
        except ValidationError as error:
            raise PluginError(_problems(document, error, ("simulated",))) from error
        return simulated_class(name, preset, base.Options, device)


def driver_class(name: str, preset: Preset, base: type[Gauge[Any]]) -> type[Gauge[Any]]:
    """A class that differs from its base driver only in its options.

    Raises ValueError if an option is `like` one that the base driver has not, ValidationError where `sample`
    are no options of this preset.
    """
    camel = _camel(name)
    options_model = preset.options_model(f"{camel}Options", base.Options)

    def initialise(self: Any, options: Any) -> None:
        base.__init__(self, preset.gauge_options(options, base.Options))
        self.options = options

    described = type(
        camel,
        (base,),
        {
            "__init__": initialise,
            "__doc__": preset.delivers,
            "__module__": f"{__name__}.{name}",
            "Options": options_model,
            "absolute": preset.absolute,
            "range_option": next((key for key, each in preset.options.items() if each.like == "channels.range"), ""),
            "about": f"{preset.title}\n\nSource: {preset.source}".strip(),
            "sample_options": preset.sample,
            "sample_range": preset.sample_range,
            "usual_line": (preset.line.baud, preset.line.format) if preset.line else None,
        },
    )
    options_model.model_validate({"driver": name, "line": "line", **preset.sample})
    return described


def simulated_class(name: str, preset: Preset, base_options: type[BaseModel], device: Any) -> type:
    """The base protocol's simulated device for this description. Unread channels have their sensor off."""

    def initialise(self: Any, options: Any, sense: Any) -> None:
        described: Any = preset.simulated_options(options, base_options)
        gauge: Any = preset.gauge_options(options, base_options)
        read_channels = {channel.name for channel in gauge.channels}
        device.__init__(self, described, lambda channel: sense(channel) if channel in read_channels else math.nan)

    return type(f"Simulated{_camel(name)}", (device,), {"__init__": initialise, "__doc__": preset.title})


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def _problems(document: Document, error: ValidationError, root: Location = ()) -> list[Problem]:
    """Each of pydantic's errors with its line in the file; of a filled-in description with its place under `gauge`."""
    problems = []
    for detail in error.errors(include_url=False):
        context = detail.get("ctx", {})
        in_description = getattr(context.get("error"), "__cause__", None)
        if isinstance(in_description, ValidationError):
            problems += _problems(document, in_description, ("gauge",))
            continue
        location = (*root, *detail["loc"])
        value, unknown = document.value(location), detail["type"] == "extra_forbidden"
        problems.append(
            Problem(
                document.where(location),
                WORDS.get(detail["type"], detail["msg"].removeprefix("Value error, ")),
                value="" if unknown or value is None or isinstance(value, dict | list) else str(value),
                allowed=str(context.get("expected") or context.get("pattern") or ""),
                next_step="drivers/compd_drivers/presets/README.md says what a preset may hold",
            )
        )
    return problems
