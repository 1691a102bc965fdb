"""The file of what was measured, from which the documentation is generated."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.injection.cells.cell import NO_FAULT, all_cells
from tests.injection.matrix import MATRIX

# Of a cell, what the documentation shows.
SHOWN = ("faults", "situation", "worst_um", "worst_bound_um", "most", "beyond", "setpoints")


def write(path: Path, outcomes: Sequence[Mapping[str, Any]], cells: Sequence[Mapping[str, Any]]) -> None:
    """What happened to each case, and in each cell; beside what the file has of those that were not tried."""
    document = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    known = document.get("outcomes", {}) | {outcome["case"]: outcome for outcome in outcomes}
    shown = {_name(cell): {key: cell[key] for key in SHOWN} for cell in [*document.get("cells", []), *cells]}
    written = {
        "command": f'make faults OPTIONS="--write {path}"',
        "outcomes": {case.id: known[case.id] for case in MATRIX if case.id in known},
        "cells": [shown[cell.name] for cell in all_cells() if cell.name in shown],
    }
    path.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")


def _name(cell: Mapping[str, Any]) -> str:
    """The name of `Cell`."""
    return f"{'+'.join(cell['faults']) or NO_FAULT}@{cell['situation']}"
