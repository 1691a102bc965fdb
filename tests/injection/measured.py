"""The file of what was measured, from which the documentation is generated."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.injection.matrix import MATRIX

# Of a cell, what the documentation shows.
SHOWN = ("faults", "situation", "worst_um", "worst_bound_um", "most", "beyond", "setpoints")


def write(path: Path, outcomes: Sequence[dict[str, Any]], cells: Sequence[dict[str, Any]]) -> None:
    """What happened to each case, and in each cell; beside what the file has of cases that were not tried.

    Cells take the place of those of the run before.
    """
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    known = document.get("outcomes", {}) | {outcome["case"]: outcome for outcome in outcomes}
    written: dict[str, Any] = {"command": f'make faults OPTIONS="--write {path}"'}
    written["outcomes"] = {case.id: known[case.id] for case in MATRIX if case.id in known}
    written["cells"] = [{key: cell[key] for key in SHOWN} for cell in cells] or document.get("cells", [])
    path.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")
