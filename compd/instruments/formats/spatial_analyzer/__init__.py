"""SpatialAnalyzer's ASCII export, recognised by its comments."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.instruments.axes import POSITION_AXES
from compd.instruments.instrument_format import TextFormat, WrittenForm

if TYPE_CHECKING:
    from compd.instruments.export import ReadOptions
    from compd.instruments.raw_table import RawTable
    from compd.instruments.samples import Samples
    from compd.instruments.text_file import TextFile

# Kind of the axes, their names, and their unit: `AXES = CARTESIAN: X,  Y,  Z (mm)`.
AXES = r"axes\s*=\s*(\w+)\s*:?\s*([^(]*?)\s*(?:\(\s*([^)]*?)\s*\))?\s*$"


def _read(text: TextFile, options: ReadOptions) -> RawTable:
    from compd.instruments.formats.spatial_analyzer.reader import read_spatial_analyzer

    return read_spatial_analyzer(text, options)


def _write(samples: Samples) -> bytes:
    from compd.instruments.formats.spatial_analyzer.writer import write_spatial_analyzer

    return write_spatial_analyzer(samples)


FORMAT = TextFormat(
    name="sa",
    title="SpatialAnalyzer",
    file_is="SpatialAnalyzer's ASCII export: `//` lines with version, frame, axes and unit, then collection, group, "
    "target, x, y, z and, if exported, a stamp. Without the `//` lines: number, x, y, z",
    finds="unit and frame; names; groups; stamps of whole seconds, with many rows in each",
    ending=".txt",
    read=_read,
    mark=rf"^\s*//.*?(?:spatialanalyzer|{AXES})",
    written=(
        WrittenForm(
            name="sa",
            title="SpatialAnalyzer ASCII",
            summary="SpatialAnalyzer ASCII, stamps of whole seconds",
            write_bytes=_write,
            axes=(POSITION_AXES,),
        ),
    ),
)
