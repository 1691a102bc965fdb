"""A text file as lines, whatever encoding and line ends it was written with."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from compd.errors import RecordingError
from compd.files import read_small_file
from compd.instruments.read_limits import ReadLimits
from compd.tables import ProblemList

# Largest file (bytes): some four million rows, a day of a tracker with 50 samples a second.
MAX_BYTES = 256 * 2**20
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_CONTROL_BYTES = bytes([*range(9), *range(14, 32), 127])
_UTF8_MARK, _UTF16_MARKS = b"\xef\xbb\xbf", (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True)
class TextFile:
    """The lines of a text file."""

    path: Path  #: the file
    lines: list[str]  #: without their ends; the first is line 1 for a person
    encoding: str  #: in words
    complete: bool  #: whether the last line has an end


def read_content(path: Path) -> bytes:
    """The bytes of a regular file. Raises RecordingError if it cannot be read, is empty or too long."""
    problems = ProblemList(path)
    try:
        content = read_small_file(path, MAX_BYTES)
    except OSError as error:
        problems.refuse(0, f"cannot be read: {error.strerror}", next_step="give the path of the instrument's export")
    if not content:
        problems.add(0, "is empty", allowed="rows of numbers")
    problems.check()
    return content


def decode_text(path: Path, content: bytes, limits: ReadLimits) -> TextFile:
    """Text in UTF-8, in UTF-16 with a byte order mark, or else in Windows-1252.

    Raises RecordingError, with the line, for what is no text, has more lines than `limits` allow, or a longer line.
    """
    problems = ProblemList(path)
    if content.startswith(_UTF16_MARKS):
        text, encoding = _decoded(content, "utf-16", problems), "UTF-16"
    else:
        marked = content.startswith(_UTF8_MARK)
        try:
            text, encoding = content.decode("utf-8-sig"), "UTF-8 with a byte order mark" if marked else "UTF-8"
        except UnicodeDecodeError:
            text, encoding = _decoded(content, "cp1252", problems), "Windows-1252, as it is no UTF-8"
    # programs of DOS times end a file so
    text = text.removesuffix("\x1a")
    # bytes are looked through ten times faster than characters
    clean = encoding != "UTF-16" and len(content.translate(None, _CONTROL_BYTES)) == len(content)
    control = None if clean else _CONTROL.search(text)
    if control:
        problems.add(
            text.count("\n", 0, control.start()) + 1,
            "is not text",
            f"a byte 0x{ord(control[0]):02x}",
            "text, or a file of a format that `compd recording join --help` lists at --as",
            "export as text from the instrument's program",
        )
    problems.check()
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    count = text.count("\n")
    if count > limits.lines:
        problems.refuse(0, "has too many lines", str(count), f"{limits.lines}", "split the file, or leave out samples")
    lines = text.split("\n")
    _check_length(lines, limits, problems)
    complete = not lines[-1]
    return TextFile(path, lines[:-1] if complete else lines, encoding, complete)


def _check_length(lines: list[str], limits: ReadLimits, problems: ProblemList) -> None:
    longest = max(range(len(lines)), key=lambda k: len(lines[k]))
    if len(lines[longest]) > limits.line_characters:
        problems.add(
            longest + 1,
            "is too long for a row of measurements",
            f"{len(lines[longest])} characters",
            f"{limits.line_characters} in a line",
            "export one row of the table in a line",
        )
    problems.check()


def _decoded(content: bytes, encoding: str, problems: ProblemList) -> str:
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        newline = "\n".encode(encoding)[-2:] if encoding == "utf-16" else b"\n"
        problems.add(
            content.count(newline, 0, error.start) + 1,
            "is not text in any encoding that is known",
            f"byte 0x{content[error.start]:02x}",
            "UTF-8, UTF-16 with a byte order mark, or Windows-1252",
            "save it as UTF-8",
        )
        raise RecordingError(problems.problems) from error
