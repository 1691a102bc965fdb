"""What a format of instruments declares: how its files are recognised, read, and written by the simulated instrument.

Declarations are imported by every command line and page, so they import neither NumPy nor a reader: `read` and
`write_bytes` import what they need when they are called.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from compd.instruments.axes import LENGTH_AXES, POSE_AXES, POSITION_AXES

if TYPE_CHECKING:
    from pathlib import Path

    from compd.instruments.export import InstrumentExport, ReadOptions
    from compd.instruments.raw_table import RawTable
    from compd.instruments.read_limits import ReadLimits
    from compd.instruments.samples import Samples
    from compd.instruments.text_file import TextFile


@dataclass(frozen=True, kw_only=True)
class WrittenForm:
    """One form in which the simulated instrument writes a format: a name of `compd sim tracker --as`."""

    name: str  #: of the form
    title: str  #: of what is written, for messages: "delimited text"
    summary: str  #: what sets this form apart, for the help: "commas, decimal point, ISO date stamps"
    write_bytes: Callable[[Samples], bytes]  #: the bytes of the file; called with samples that the form can hold
    axes: tuple[tuple[str, ...], ...] = (LENGTH_AXES, POSITION_AXES, POSE_AXES)  #: sets of axes that the form holds
    holds_points: bool = True  #: whether it holds points without a time
    #: whether rows stand at equal distances in time, because they have no time of their own
    constant_rate: bool = False
    #: says_rate, says_unit: whether the file states the times or the rate of its rows, and the unit of its lengths
    says_rate: bool = True
    says_unit: bool = True
    resolution_mm: float = 1e-6  #: step between two lengths that can be written, mm

    def write(self, samples: Samples) -> bytes:
        """The bytes of the file. Raises CompdError for samples that the form cannot hold."""
        samples.need(self.title, *self.axes, time=not self.holds_points)
        return self.write_bytes(samples)


@dataclass(frozen=True, kw_only=True)
class InstrumentFormat:
    """A format of exports: a name of `compd recording join --as`."""

    name: str  #: of the format
    title: str  #: short, for the page: "SpatialAnalyzer"
    file_is: str  #: what such a file is and which instrument or program writes it, in Markdown
    finds: str  #: what is found in such a file, in Markdown
    ending: str  #: usual ending of the file's name. Files are recognised by their content alone.
    written: tuple[WrittenForm, ...] = ()  #: forms in which the simulated instrument writes it


@dataclass(frozen=True, kw_only=True)
class TextFormat(InstrumentFormat):
    """A format of text."""

    read: Callable[[TextFile, ReadOptions], RawTable]  #: the table in a text. Raises RecordingError.
    #: regular expression of a line among the first of the file by which the format is recognised, case ignored; "" for
    #: a format that is read where no other is recognised
    mark: str = ""


class OutdatedFile(NamedTuple):
    """A file that is recognised and refused. what, next_step : of the problem."""

    what: str
    next_step: str


@dataclass(frozen=True, kw_only=True)
class BinaryFormat(InstrumentFormat):
    """A format of bytes."""

    #: the table in a file, or the whole export where it has no columns of text. Raises RecordingError.
    read: Callable[[Path, ReadOptions], RawTable | InstrumentExport]
    magic: bytes  #: first bytes of every such file
    #: first bytes of older files, which are refused
    outdated: Mapping[bytes, OutdatedFile] = field(default_factory=dict)
    #: names of the sheets in a file; None for a format without sheets. Raises RecordingError.
    sheet_names: Callable[[Path, ReadLimits], tuple[str, ...]] | None = None
