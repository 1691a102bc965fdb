"""Renishaw CARTO `.rtx`: one length at a constant rate, little-endian numbers behind a header of text.

Read by a description of the format; no file of an instrument was tried:

    HEADER::
    Key: value                       lines that end in CR LF; a line NAME:: begins a group of keys
    Data:
    <`Sample no` numbers, IEEE 754 double precision, little-endian>
    EOF::

The file does not state the unit of its numbers, so a person does.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from compd.arrays import FloatArray
from compd.errors import Problem, RecordingError
from compd.files import read_small_file
from compd.instruments.axes import LENGTH_AXES
from compd.instruments.export import InstrumentExport, ReadOptions
from compd.instruments.formats.carto import MAGIC
from compd.units import UNIT_KINDS, unit_factor

RATE_KEY, COUNT_KEY, DATE_KEY = "Actual sample rate", "Sample no", "Date"
NOT_TRIED = "Renishaw CARTO .rtx, read by a description of the format: no file of an instrument was tried"
_DATA = re.compile(rb"^Data:[ \t]*\r?\n", re.MULTILINE)
_END = b"EOF::"
_NUMBER_BYTES = 8
# Longest header and file (bytes). The header has some twenty lines; 100 million samples are half an hour at the fastest
# rate, 50 kHz.
_MAX_HEADER = 64 * 1024
_MAX_FILE = 800_000_000
_NUMBER = re.compile(r"\+?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_SHOWN = 5
# Options for text or for positions, without a meaning here.
_OF_OTHERS = ("columns", "names", "angle_unit", "decimal", "dates", "group", "sheet")


def read_carto(path: Path, options: ReadOptions) -> InstrumentExport:
    """Read an `.rtx` file: lengths in mm, time in s from the first sample.

    options : `unit` is needed. `rate_hz` is taken in place of the header's rate, for a file that has none.

    Raises
    ------
    RecordingError
        With every problem: no header or data, no unit, no rate, a number of samples that differs from what is there,
        no end, values that are no numbers.
    """
    try:
        content = read_small_file(path, _MAX_FILE)
    except OSError as error:
        raise RecordingError.of(
            str(path), f"cannot be read: {error.strerror or error}", next_step="check the path"
        ) from error
    reader = _CartoReader(path, options)
    export = reader.read(content)
    if export is None or reader.problems:
        raise RecordingError(reader.problems)
    return export


@dataclass(frozen=True)
class _HeaderLine:
    number: int
    value: str


class _CartoReader:
    """One pass over one file; every problem is kept."""

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self._path, self._options = path, options
        self.problems: list[Problem] = []

    def read(self, content: bytes) -> InstrumentExport | None:
        data = _DATA.search(content[:_MAX_HEADER])
        if not content.lstrip().startswith(MAGIC):
            self._add(":1", "is no CARTO .rtx", "", "a file that begins with HEADER::", "check --as")
        elif data is None:
            self._add("", "has no data", allowed="a line `Data:`", next_step="export it again: the file is incomplete")
        if self.problems or data is None:
            return None
        header = self._header(content[: data.start()])
        self._check_options()
        factor_mm = self._factor_mm()
        rate_hz, rate_from = self._rate(header)
        values = self._values(content[data.end() :], self._count(header))
        self._check_finite(values)
        if self.problems:
            return None
        count = len(values)
        taken = {
            "format": NOT_TRIED,
            "length": f"{count} numbers behind `Data:`, {self._options.unit} by --unit",
            "time": f"from 0, {rate_hz:.10g} samples per second {rate_from}",
        }
        if DATE_KEY in header:
            taken["date"] = f"{header[DATE_KEY].value} in the header, not used: the clock begins at 0"
        return InstrumentExport(
            path=self._path,
            shape="carto",
            line=np.arange(1, count + 1),
            axes=LENGTH_AXES,
            values=values[:, None] * factor_mm,
            time_s=np.arange(count) / rate_hz,
            taken=taken,
        )

    def _header(self, text: bytes) -> dict[str, _HeaderLine]:
        """Key -> value with its line; a key that is there twice with two values is a problem."""
        header: dict[str, _HeaderLine] = {}
        for number, line in enumerate(text.decode("latin-1").splitlines(), start=1):
            key, colon, value = (part.strip() for part in line.partition(":"))
            if not colon or value.startswith(":"):
                continue
            if key in header and header[key].value != value and key in (RATE_KEY, COUNT_KEY):
                self._add(f":{number} {key}", "is there twice, with two values", value, header[key].value)
            header.setdefault(key, _HeaderLine(number, value))
        return header

    def _check_options(self) -> None:
        for name in _OF_OTHERS:
            if getattr(self._options, name):
                option = "--x, --y ..." if name == "names" else f"--{name.replace('_', '-')}"
                self._add("", f"has nothing that {option} could say", next_step=f"leave {option} out")

    def _factor_mm(self) -> float:
        """mm per unit; a problem where a person has not said which unit."""
        unit = self._options.unit
        factor = None if unit is None else unit_factor(unit, "mm")
        if factor is None:
            what = "does not say in which unit its lengths are" if unit is None else "is no unit of a length"
            step = "give --unit, as the instrument's software shows the lengths"
            self._add("", what, unit or "", ", ".join(UNIT_KINDS[0]), step)
        return factor or np.nan

    def _rate(self, header: dict[str, _HeaderLine]) -> tuple[float, str]:
        """Samples per second, and in words from where."""
        given = self._options.rate_hz
        line = header.get(RATE_KEY)
        if given is not None:
            if not 0 < given < np.inf:
                self._add("", "no rate", f"{given:g}", "more than 0 Hz", "give --rate-hz")
            return given, "by --rate-hz" + (f"; the header says {line.value}" if line is not None else "")
        step = "give --rate-hz, if you know it"
        if line is None:
            self._add("", f"the header has no `{RATE_KEY}`", allowed="samples per second", next_step=step)
            return np.nan, ""
        rate_hz = float(line.value) if _NUMBER.fullmatch(line.value) else np.nan
        if not 0 < rate_hz < np.inf:
            self._add(f":{line.number} {RATE_KEY}", "is no rate", line.value, "a number above 0, in Hz", step)
        return rate_hz, f"by `{RATE_KEY}`"

    def _count(self, header: dict[str, _HeaderLine]) -> int | None:
        """Samples by the header; None if it does not say, which is a problem."""
        line = header.get(COUNT_KEY)
        if line is not None and line.value.isascii() and line.value.isdigit() and int(line.value):
            return int(line.value)
        where, value = ("", "") if line is None else (f":{line.number} {COUNT_KEY}", line.value)
        what = f"the header has no `{COUNT_KEY}`" if line is None else "is no number of samples"
        self._add(where, what, value, "1 or more", "export it again")
        return None

    def _values(self, data: bytes, count: int | None) -> FloatArray:
        """(N,) the numbers in the file's unit; a problem where there are not as many as the header says."""
        if count is None:
            return np.zeros(0)
        size = count * _NUMBER_BYTES
        if data[size:].strip() == _END:
            return np.frombuffer(data, "<f8", count)
        body = data.rstrip()
        ended = body.endswith(_END)
        there = len(body.removesuffix(_END)) if ended else len(data)
        whole, rest = divmod(there, _NUMBER_BYTES)
        bytes_text = f"{whole} numbers" + (f" and {rest} bytes" if rest else "")
        if not ended:
            what = "has no end" if there >= size else "is cut off"
            self._add("", what, f"{bytes_text} behind `Data:`", f"{count} numbers, then EOF::", "copy the file again")
        else:
            self._add("", "has not as many samples as its header says", bytes_text, f"{count}", "export it again")
        return np.zeros(0)

    def _check_finite(self, values: FloatArray) -> None:
        wrong = np.flatnonzero(~np.isfinite(values)) + 1
        if len(wrong):
            shown = ", ".join(map(str, wrong[:_SHOWN])) + (f" and {len(wrong) - _SHOWN} more" * (len(wrong) > _SHOWN))
            value = ", ".join(f"{value:g}" for value in values[wrong[:_SHOWN] - 1])
            self._add(f": sample {shown}", "is not finite", value, "a length", "measure again: the beam was cut")

    def _add(self, place: str, what: str, value: str = "", allowed: str = "", next_step: str = "") -> None:
        self.problems.append(Problem(f"{self._path}{place}", what, value=value, allowed=allowed, next_step=next_step))
