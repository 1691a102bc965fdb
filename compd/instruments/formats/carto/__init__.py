"""Renishaw CARTO `.rtx`, dynamic capture: one length at a constant rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.instruments.axes import LENGTH_AXES
from compd.instruments.instrument_format import BinaryFormat, WrittenForm

if TYPE_CHECKING:
    from pathlib import Path

    from compd.instruments.export import InstrumentExport, ReadOptions
    from compd.instruments.samples import Samples

MAGIC = b"HEADER::"


def _read(path: Path, options: ReadOptions) -> InstrumentExport:
    from compd.instruments.formats.carto.reader import read_carto

    return read_carto(path, options)


def _write(samples: Samples) -> bytes:
    from compd.instruments.formats.carto.writer import write_carto

    return write_carto(samples)


FORMAT = BinaryFormat(
    name="carto",
    title="CARTO",
    file_is="Renishaw CARTO, dynamic capture (`.rtx`)",
    finds="one length at a known rate",
    ending=".rtx",
    magic=MAGIC,
    read=_read,
    written=(
        WrittenForm(
            name="carto",
            title="CARTO .rtx",
            summary="Renishaw CARTO .rtx, one link's length",
            write_bytes=_write,
            axes=(LENGTH_AXES,),
            holds_points=False,
            constant_rate=True,
            says_unit=False,
        ),
    ),
)
