"""Text with a delimiter: what spreadsheets and most programs export."""

from __future__ import annotations

from typing import TYPE_CHECKING

from compd.instruments.instrument_format import TextFormat, WrittenForm

if TYPE_CHECKING:
    from compd.instruments.export import ReadOptions
    from compd.instruments.raw_table import RawTable
    from compd.instruments.samples import Samples
    from compd.instruments.text_file import TextFile


def _read(text: TextFile, options: ReadOptions) -> RawTable:
    from compd.instruments.delimited import read_delimited

    return read_delimited(text, options)


def _write_csv(samples: Samples) -> bytes:
    from compd.instruments.formats.delimited.writer import write_csv

    return write_csv(samples)


def _write_iso(samples: Samples) -> bytes:
    from compd.instruments.formats.delimited.writer import write_iso

    return write_iso(samples)


def _write_german(samples: Samples) -> bytes:
    from compd.instruments.formats.delimited.writer import write_german

    return write_german(samples)


_TITLE = "delimited text"
FORMAT = TextFormat(
    name="csv",
    title="text with a delimiter",
    file_is="text with commas, semicolons, tabs or pipes, with or without a header",
    finds="delimiter; decimal mark; comments (`#`, `//`, `%`, `;`); units in the header (`X [mm]`, `x_mm`, `X (inch)`) "
    "or in a row below it; a comment such as `# units: mm`; the columns by their English or German names (`Time`, "
    "`Zeit`, `Punkt`, `Länge`, ...)",
    ending=".csv",
    read=_read,
    written=(
        WrittenForm(name="csv", title=_TITLE, summary="commas, decimal point, seconds", write_bytes=_write_csv),
        WrittenForm(name="iso", title=_TITLE, summary="commas, decimal point, ISO date stamps", write_bytes=_write_iso),
        WrittenForm(
            name="german",
            title=_TITLE,
            summary="semicolons, decimal comma, German date stamps",
            write_bytes=_write_german,
        ),
    ),
)
