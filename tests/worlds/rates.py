"""Kinds of fault and their rates, as `rates.yaml` and files like it state them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from tests.worlds.faults import FAMILIES

FILE = Path(__file__).with_name("rates.yaml")
COLUMNS = ("usual", "campaign")
# Ordinary work, without any fault.
NONE = "none"


class Kind(NamedTuple):
    """A kind of fault.

    per_hour : its rate. target : the sort of thing that it happens to. fault : False for ordinary work.
    parameters : the range of each, by name.
    """

    family: str
    name: str
    per_hour: float
    target: str
    fault: bool
    parameters: Mapping[str, Any]


def kinds(column: str = "usual", path: Path = FILE) -> list[Kind]:
    """Every kind of a file, in its order.

    column : "usual" or "campaign"; "none" has the rates of "usual" for ordinary work and 0 for the faults.
    Raises ValueError for a kind that no function plays.
    """
    found = []
    for family, rows in yaml.safe_load(path.read_text(encoding="utf-8")).items():
        for name, row in rows.items():
            if not callable(getattr(FAMILIES.get(family), name, None)):
                raise ValueError(f"{path}: {family}.{name}: no function of tests.worlds.faults plays this kind")
            fault = row.get("fault", True)
            is_work = not fault and family == "machine"
            per_hour = float(row["usual"] * is_work if column == NONE else row[column])
            found.append(Kind(family, name, per_hour, row["target"], fault, row.get("parameters", {})))
    return found


def kinds_of(rates: str) -> list[Kind]:
    """The kinds for the option `--rates`: the name of a column, "none", or a file, of which "campaign" is used."""
    return kinds(rates) if rates in (*COLUMNS, NONE) else kinds("campaign", Path(rates))
