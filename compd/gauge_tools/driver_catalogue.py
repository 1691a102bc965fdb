"""The installed gauge drivers and presets: description, source of the protocol, and options."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import BaseModel

from compd.gauge import Gauge
from compd.plugins import GAUGES, SIMULATED_GAUGES, load, names
from compd.pushed_gauge import PushedGauge

GIVEN_BY_THE_CONFIGURATION = ("driver", "line")  # needed by every gauge, of no interest in a list


@dataclass(frozen=True)
class CatalogueEntry:
    """One driver: `title` is the first line of its text, `needed_options` are those without a default."""

    name: str
    line_kind: str
    title: str
    needed_options: tuple[str, ...]
    simulated: bool


@dataclass(frozen=True)
class DriverOption:
    """One key of a gauge in the configuration; `default` is Python's text of it, "" if the option is needed."""

    name: str
    default: str
    meaning: str

    @property
    def needed(self) -> bool:
        return not self.default


@dataclass(frozen=True)
class DriverDescription:
    """Text of `compd gauge show`."""

    text: str
    options: tuple[DriverOption, ...]


def catalogue() -> list[CatalogueEntry]:
    """Every installed driver, sorted by name. Raises PluginError for one that cannot be loaded."""
    simulated = set(names(SIMULATED_GAUGES))
    entries = []
    for name in names(GAUGES):
        driver = load(GAUGES, name, name)
        needed = [key.rstrip("_") for key, field in driver.Options.model_fields.items() if field.is_required()]
        entries.append(
            CatalogueEntry(
                name,
                driver.line_kind,
                driver_text(driver).partition("\n")[0],
                tuple(key for key in needed if key not in GIVEN_BY_THE_CONFIGURATION),
                name in simulated,
            )
        )
    return entries


def polled_drivers() -> list[str]:
    """Sorted names of the drivers with polled devices."""
    return [name for name in names(GAUGES) if not issubclass(load(GAUGES, name, name), PushedGauge)]


def driver_description(name: str) -> DriverDescription:
    """Text and options of the driver `name`. Raises PluginError if there is none."""
    driver = load(GAUGES, name, name)
    return DriverDescription(driver_text(driver), tuple(_options(driver.Options)))


def _options(model: type[BaseModel], within: str = "") -> Iterator[DriverOption]:
    """The keys of a model, each section's own keys behind it: `channels`, `channels.type` ..."""
    for key, field in model.model_fields.items():
        name = f"{within}{field.alias or key}"
        default = "" if field.is_required() else repr(field.get_default(call_default_factory=True))
        yield DriverOption(name, default, field.description or "")
        for section in _sections(field.annotation):
            yield from _options(section, f"{name}.")


def _sections(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models in a key's type: itself, the items of a list, the content of an optional."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _sections(argument)


def driver_text(driver: type[Gauge[Any]]) -> str:
    """Protocol of the device and its source: `about`, else the docstring of the module, else of the class."""
    return driver.about or inspect.getdoc(inspect.getmodule(driver)) or inspect.getdoc(driver) or ""
