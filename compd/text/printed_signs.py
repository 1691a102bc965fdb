"""Units and signs as people read them on pages: files, messages and terminals are written without Greek letters."""

from __future__ import annotations

import re

# A unit that stands alone or in a quotient, no part of a name such as tip_x_um, of an option or of a path.
_MICRO = re.compile(r"(?<![\w.-])u(m|rad|in)\b(?!\.\w|[=(])")
_CELSIUS = re.compile(r"(?<![\w.-])degC\b")


def typeset(text: str) -> str:
    """The text with signs of print: "0.12 +- 0.02 um/K" is "0.12 ± 0.02 µm/K"; a name such as `tip_x_um` stays."""
    return _CELSIUS.sub("°C", _MICRO.sub(r"µ\1", text)).replace("+- ", "± ").replace(" -> ", " → ")
