"""Columns between blanks: x y z without header and without time, as controllers of trackers stream them."""

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


def _write(samples: Samples) -> bytes:
    from compd.instruments.formats.blanks.writer import write_blanks

    return write_blanks(samples)


FORMAT = TextFormat(
    name="blanks",
    title="text between blanks",
    file_is="columns between blanks",
    finds="the same as of `csv`",
    ending=".dat",
    read=_read,
    written=(
        WrittenForm(
            name="blanks",
            title="columns between blanks",
            summary="numbers between blanks, nothing else",
            write_bytes=_write,
            constant_rate=True,
            says_rate=False,
            says_unit=False,
        ),
    ),
)
