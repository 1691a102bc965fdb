"""The file of what was measured, from which the documentation is generated: two runs write a part of it each."""

from __future__ import annotations

import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tests.injection.matrix import MATRIX
from tests.injection.trial import Outcome

# Of a cell, what the documentation shows.
SHOWN = ("faults", "situation", "worst_um", "worst_bound_um", "most", "beyond", "setpoints")


def write_outcomes(path: Path, outcomes: Sequence[Outcome]) -> None:
    """What happened to each case, beside what the file has of other cases that are still in the matrix."""
    document = _read(path)
    known = document.get("outcomes", {}) | {outcome.case: outcome.as_data() for outcome in outcomes}
    document |= _run("python -m tests.injection", path)
    _write(path, document | {"outcomes": {case.id: known[case.id] for case in MATRIX if case.id in known}})


def write_cells(path: Path, results: Sequence[dict[str, Any]]) -> None:
    """Every fault in every situation; in place of those of the run before."""
    shown = [{key: result[key] for key in SHOWN} for result in results]
    _write(path, _read(path) | {"cells": _run("make faults", path) | {"results": shown}})


def _run(command: str, path: Path) -> dict[str, Any]:
    options = f'OPTIONS="--write {path}"' if command.startswith("make") else f"--write {path}"
    return {"command": f"{command} {options}", "date": datetime.now(UTC).date().isoformat()}


def _read(path: Path) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return document


def _write(path: Path, document: dict[str, Any]) -> None:
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
