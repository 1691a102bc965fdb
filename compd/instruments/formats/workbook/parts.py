"""The parts of an .xlsx file, a zip archive: what is no workbook, what is too large, formulas and merged cells."""

from __future__ import annotations

import re
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

from compd.errors import Problem, RecordingError
from compd.instruments.read_limits import ReadLimits

# Largest file (bytes) on the disk.
MAX_BYTES = 200_000_000
# Exceptions of reading a damaged file; a SyntaxError stands for malformed XML.
BROKEN = (
    *(ValueError, KeyError, IndexError, TypeError, AttributeError, SyntaxError, EOFError, OSError, OverflowError),
    *(NotImplementedError, RuntimeError, zipfile.BadZipFile, zlib.error),
)
_ZIP, _OLD = b"PK\x03\x04", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_CHUNK = 1 << 20
# Overlap (bytes) of chunks, longer than the searched text, which may lie across two of them.
_OVERLAP = 100
_FORMULA = re.compile(rb"<(?:\w+:)?f[ >/]")
# Of a sheet, and of the table of texts.
_CELL = re.compile(rb"<(?:\w+:)?(?:c|si)[ >/]")
_MERGED = re.compile(rb"<(?:\w+:)?mergeCell [^>]*?ref=\"(([A-Z]{1,3})(\d{1,7}):([A-Z]{1,3})(\d{1,7}))\"")
# Hidden by hand, by a filter or in a group that is folded up; or of no height.
_ROW = re.compile(rb"<(?:\w+:)?row ([^>]*)>")
_ROW_NUMBER = re.compile(rb"\br=\"(\d{1,7})\"")
_HIDDEN = re.compile(rb"\bhidden=\"(?:1|true)\"|\bht=\"0(?:\.0*)?\"")
_SAVE_AS = "open it in a spreadsheet and save it as .xlsx, without a password"


@dataclass(frozen=True)
class MergedArea:
    """name : as in the sheet, "A3:A5". first_row, last_row : from 1."""

    name: str
    first_row: int
    last_row: int


@dataclass(frozen=True)
class SheetPart:
    """has_formulas : whether any cell has one. merged : areas of merged cells. hidden : rows that are not shown."""

    has_formulas: bool
    merged: tuple[MergedArea, ...]
    hidden: frozenset[int] = frozenset()


def check_workbook_file(path: Path, limits: ReadLimits) -> None:
    """Raise RecordingError for what is no .xlsx file, cannot be read, or unpacks to more than a list can have.

    Cells are counted: a reader of XML would have to go through all of them, before it knows how many there are.
    """
    try:
        if not path.is_file():
            raise FileNotFoundError(2, "no such file")
        with path.open("rb") as file:
            begin = file.read(8)
        size = path.stat().st_size
    except OSError as error:
        raise RecordingError.of(str(path), f"cannot be read: {error.strerror}") from error
    if begin == _OLD:
        what = "is of an Excel before 2007 (.xls), or has a password"
        raise RecordingError.of(str(path), what, allowed=".xlsx", next_step=_SAVE_AS)
    if not begin.startswith(_ZIP):
        raise RecordingError.of(str(path), "is no .xlsx file", allowed=".xlsx", next_step="check --as")
    try:
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(part.file_size for part in archive.infolist())
            names = archive.namelist()
    except BROKEN as error:
        raise RecordingError(unreadable(path, why_broken(error))) from error
    if size > MAX_BYTES or unpacked > limits.unpacked_bytes:
        raise RecordingError.of(
            str(path),
            "is too large for a list of measurements",
            value=f"{size} bytes, unpacked {unpacked}",
            allowed=f"{MAX_BYTES} bytes, unpacked {limits.unpacked_bytes}",
            next_step="save the sheet as CSV",
        )
    if not any(name.endswith(("workbook.xml", "workbook.bin")) for name in names):
        raise RecordingError(unreadable(path, "it is an archive, and no workbook"))
    if any(name.endswith("workbook.bin") for name in names):
        raise RecordingError.of(str(path), "is a binary workbook (.xlsb)", allowed=".xlsx", next_step=_SAVE_AS)
    try:
        for name in names:
            if name.lower().endswith(".xml"):  # a sheet may have any name
                _check_cells(path, name, limits)
    except BROKEN as error:
        raise RecordingError(unreadable(path, str(error) or type(error).__name__)) from error


def _check_cells(path: Path, name: str, limits: ReadLimits) -> None:
    """Raise RecordingError if a part has too many cells, or texts that cells name, whatever it says of its size."""
    count, rest = 0, b""
    with zipfile.ZipFile(path) as archive, archive.open(name) as file:
        while chunk := file.read(_CHUNK):
            text = rest + chunk
            # a tag that is cut by the chunk's end is counted with the next one
            end = max(text.rfind(b"<"), 0)
            count += len(_CELL.findall(text, 0, end))
            rest = text[end:][:_OVERLAP]
            if count > limits.sheet_cells:
                raise RecordingError.of(
                    str(path),
                    "has too many cells for a list of measurements in a workbook",
                    value=f"{name}: more than {limits.sheet_cells}",
                    allowed=f"{limits.sheet_cells} cells in a sheet, and as many texts",
                    next_step="save the sheet as CSV, which is read much faster",
                )


def why_broken(error: Exception) -> str:
    """Why a workbook cannot be read. The words of other errors than an archive's may be a part of the file."""
    words = str(error) if isinstance(error, zipfile.BadZipFile | NotImplementedError | EOFError) else ""
    return words if words and "'" not in words else type(error).__name__


def unreadable(path: Path, reason: str) -> Problem:
    """The problem of a workbook that is damaged."""
    return Problem(
        str(path), f"cannot be read as .xlsx: {reason}", next_step="save it again in a spreadsheet, or as CSV"
    )


def read_sheet_part(path: Path, name: str) -> SheetPart:
    """What the reader of cells does not tell of a sheet. name : of its part in the archive."""
    has_formulas = False
    number = scanned = 0
    hidden: set[int] = set()
    merged: dict[str, MergedArea] = {}
    with zipfile.ZipFile(path) as archive, archive.open(name.lstrip("/")) as file:
        rest = b""
        while chunk := file.read(_CHUNK):
            text = rest + chunk
            has_formulas = has_formulas or _FORMULA.search(text) is not None
            for match in _MERGED.finditer(text):
                area = match[1].decode()
                merged[area] = MergedArea(area, int(match[3]), int(match[5]))
            # a tag that is cut by the chunk's end is read with the next one
            end = max(text.rfind(b"<"), 0)
            for match in _ROW.finditer(text, scanned, end):
                own = _ROW_NUMBER.search(match[1])
                number = int(own[1]) if own else number + 1
                if _HIDDEN.search(match[1]):
                    hidden.add(number)
            start = max(min(len(text) - _OVERLAP, end), len(text) - _CHUNK, 0)
            rest, scanned = text[start:], max(end - start, 0)
    return SheetPart(has_formulas, tuple(merged.values()), frozenset(hidden))
