"""Opening a line: from its settings in the configuration to what its drivers talk to."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.clock import Clock
from compd.line_settings import LineSettings, PolledLineSettings
from compd.lines.line import Line, WrapPort, unchanged
from compd.lines.registry import definition_of, polled_definition

if TYPE_CHECKING:
    from compd.lines.stream import StreamLine


def open_line(settings: LineSettings, clock: Clock, wrap_port: WrapPort = unchanged) -> Line:
    """Open a line of the settings' kind. After a LineFault with LINE_LOST, `close()` it and open a new one.

    wrap_port : as in `open_stream`; ports that are within a library stay as they are.
    Raises LineFault (LINE_LOST, with what the system said) when it cannot be opened.
    """
    return definition_of(settings).open(settings, clock, wrap_port)


def open_stream(settings: PolledLineSettings, clock: Clock, wrap_port: WrapPort = unchanged) -> StreamLine:
    """Open the stream of bytes of a line, whatever protocol is spoken over it.

    wrap_port : puts another port around the line's own, for instance one that shows every byte.
    Raises LineFault (LINE_LOST, with what the system said) when it cannot be opened.
    """
    return polled_definition(settings).stream(settings, clock, wrap_port)
