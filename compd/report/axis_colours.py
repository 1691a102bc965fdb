"""The colours of x, y and z: `templates/axes.css`, which the pages of the page's server read, too."""

from __future__ import annotations

import re
from pathlib import Path

AXES_CSS = Path(__file__).parent / "templates" / "axes.css"
AXIS_COLOURS = dict(re.findall(r"--(\w): (#\w+)", AXES_CSS.read_text(encoding="utf-8")))
