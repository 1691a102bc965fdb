"""An address as a QR code: in a terminal, or as a picture."""

from __future__ import annotations

import io
from typing import TextIO

import segno

# Width of the quiet zone around the code, in modules (ISO/IEC 18004).
_BORDER = 4
_SCALE = 4


def print_qr_code(text: str, out: TextIO) -> None:
    """Draw it on a terminal."""
    segno.make_qr(text).terminal(out, border=_BORDER, compact=True)


def svg_qr_code(text: str) -> bytes:
    """The code as an SVG document, dark on white on any background."""
    out = io.BytesIO()
    segno.make_qr(text).save(out, kind="svg", scale=_SCALE, border=_BORDER, light="#fff", dark="#000", title="QR code")
    return out.getvalue()
