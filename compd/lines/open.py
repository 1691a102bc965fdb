"""Opening a line: from its settings in the configuration to what its drivers talk to."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, Union

from pydantic import Field

from compd.clock import Clock
from compd.line_settings import LineSettings, PolledLineSettings
from compd.lines import kinds
from compd.lines.line import Line
from compd.lines.line_definition import LineDefinition, PolledDefinition
from compd.lines.ports import PORTS, Ports

if TYPE_CHECKING:
    from compd.lines.stream import StreamLine


def _definitions() -> dict[str, LineDefinition]:
    found: list[LineDefinition] = []
    for folder in iter_modules(kinds.__path__):
        definition: LineDefinition = import_module(f"{kinds.__name__}.{folder.name}").KIND
        assert definition.kind == folder.name, f"compd/lines/kinds/{folder.name} has the kind {definition.kind}"
        found.append(definition)
    return {definition.kind: definition for definition in sorted(found, key=lambda one: (one.order, one.kind))}


# By name: every folder in compd/lines/kinds. Nothing else lists them.
KINDS: Mapping[str, LineDefinition] = _definitions()
# The keys of a line of any kind, and of several lines by name, for pydantic.
ANY_LINE: Any = Annotated[Union[tuple(kind.settings for kind in KINDS.values())], Field(discriminator="kind")]  # noqa: UP007
LINES_BY_NAME: Any = GenericAlias(dict, (str, ANY_LINE))


def readable_definition(line: Any) -> LineDefinition | None:
    """Of the kind of a line of which only a part could be read; None where its kind could not."""
    return KINDS.get(getattr(line, "kind", None) or "")


def definition_of(settings: LineSettings) -> LineDefinition:
    """Of the line's kind."""
    return KINDS[settings.kind]


def polled_definition(settings: PolledLineSettings) -> PolledDefinition:
    """Of the line's kind."""
    return polled_kind(settings.kind)


def polled_kind(kind: str) -> PolledDefinition:
    """The kind of this name, whose gauges are polled."""
    definition = KINDS[kind]
    assert isinstance(definition, PolledDefinition), f"gauges on lines of kind {kind} are not polled"
    return definition


def kinds_that_carry(carries: str) -> list[LineDefinition]:
    """The kinds on which drivers find `carries`, as `Gauge.line_kind` has it."""
    return [kind for kind in KINDS.values() if kind.carries == carries]


def open_line(settings: LineSettings, clock: Clock, ports: Ports = PORTS) -> Line:
    """Open a line of the settings' kind. After a LineFault with LINE_LOST, `close()` it and open a new one.

    ports : those of this computer, or others in their place; ports that are within a library stay as they are.
    Raises LineFault (LINE_LOST, with what the system said) when it cannot be opened.
    """
    return definition_of(settings).open(settings, clock, ports)


def open_stream(settings: PolledLineSettings, clock: Clock, ports: Ports = PORTS) -> StreamLine:
    """Open the stream of bytes of a line, whatever protocol is spoken over it.

    ports : as in `open_line`.
    Raises LineFault (LINE_LOST, with what the system said) when it cannot be opened.
    """
    return polled_definition(settings).stream(settings, clock, ports)
