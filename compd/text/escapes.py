r"""Bytes as people write them in text: \r, \x02 and the like."""

from __future__ import annotations

import re

_ESCAPE = re.compile(r"\\(?:x([0-9A-Fa-f]{2})|(.))", re.DOTALL)
_ESCAPES = {"r": "\r", "n": "\n", "t": "\t", "\\": "\\"}


def unescape(text: str) -> bytes:
    r"""Bytes for text with \r \n \t \\ \xHH. ValueError for another escape, or a character beyond \xff."""

    def byte(match: re.Match[str]) -> str:
        if match[1]:
            return chr(int(match[1], 16))
        if match[2] not in _ESCAPES:
            raise ValueError(f"unknown escape \\{match[2]}; there are \\r \\n \\t \\\\ and \\xHH")
        return _ESCAPES[match[2]]

    if text.endswith("\\") and not text.endswith("\\\\"):
        raise ValueError("a single backslash at the end; write \\\\")
    try:
        return _ESCAPE.sub(byte, text).encode("latin-1")
    except UnicodeEncodeError as error:
        raise ValueError(f"{text[error.start]!r} is not a single byte; write its code as \\xHH") from error
