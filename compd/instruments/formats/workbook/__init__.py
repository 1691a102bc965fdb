"""Excel workbooks (.xlsx) with a list in one sheet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.instruments.instrument_format import BinaryFormat, OutdatedFile, WrittenForm

if TYPE_CHECKING:
    from pathlib import Path

    from compd.instruments.export import ReadOptions
    from compd.instruments.raw_table import RawTable
    from compd.instruments.read_limits import ReadLimits
    from compd.instruments.samples import Samples


def _read(path: Path, options: ReadOptions) -> RawTable:
    from compd.instruments.formats.workbook.reader import read_workbook

    return read_workbook(path, options)


def _sheet_names(path: Path, limits: ReadLimits) -> tuple[str, ...]:
    from compd.instruments.formats.workbook.reader import sheet_names

    return sheet_names(path, limits)


def _write(samples: Samples) -> bytes:
    from compd.instruments.formats.workbook.writer import write_workbook

    return write_workbook(samples)


FORMAT = BinaryFormat(
    name="xlsx",
    title="Excel",
    file_is="an Excel workbook",
    finds="the same as of `csv`, from one sheet",
    ending=".xlsx",
    magic=b"PK\x03\x04",
    outdated={
        b"\xd0\xcf\x11\xe0": OutdatedFile(
            "is an Excel workbook of before 2007", next_step="save it as .xlsx, or as text"
        )
    },
    read=_read,
    sheet_names=_sheet_names,
    written=(WrittenForm(name="xlsx", title="an Excel list", summary="an Excel list", write_bytes=_write),),
)
