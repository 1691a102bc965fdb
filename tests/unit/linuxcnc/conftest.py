"""The bridge's files are scripts for another Python: they are imported from where they lie."""

from __future__ import annotations

import sys

from tests.support.paths import CONFIG

sys.path.insert(0, str(CONFIG / "linuxcnc"))
