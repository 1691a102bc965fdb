"""A browser's request for a plan: rivals, rows and limits, each problem with its field, and the command line."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from compd.api import Range
from compd.errors import CompdError, Problem

MIN_ROWS, MAX_ROWS = 2, 400
_MAX_RIVALS = 8
_FIELDS = {"workspace_M_mm": "workspace", "temperature_degC": "temperature", "the next measurement": "workspace"}


class PlanRequest(NamedTuple):
    """Arguments of `plan_measurement`; None keeps the value of the recording."""

    rivals: list[str]
    beside: list[str]
    rows: int
    workspace_M_mm: tuple[Range, Range, Range] | None
    force_N: float | None
    temperature_degC: Range | None
    speed_mm_per_s: float | None
    limits: dict[str, Range]

    def options(self) -> list[str]:
        """The same as options of `compd plan`."""
        words = ["--rivals", ",".join(self.rivals), "--rows", str(self.rows)]
        if self.beside:
            words += ["--beside", ",".join(self.beside)]
        if self.workspace_M_mm is not None:
            words.append(f"--workspace={_text(*(end for pair in self.workspace_M_mm for end in pair))}")
        for name, value in (("force", self.force_N), ("speed", self.speed_mm_per_s)):
            words += [] if value is None else [f"--{name}", _text(value)]
        if self.temperature_degC is not None:
            words.append(f"--temperature={_text(*self.temperature_degC)}")
        for column, pair in self.limits.items():
            words += ["--limit", f"{column}={_text(*pair)}"]
        return words


def read_request(keys: Mapping[str, Any], known: Collection[str]) -> PlanRequest:
    """The request in an order's keys. known : ids of the available effects.

    Raises CompdError with every problem.
    """
    reader = _Reader(keys, known)
    request = PlanRequest(
        rivals=reader.effects("rivals"),
        beside=reader.effects("beside"),
        rows=reader.rows(),
        workspace_M_mm=reader.workspace(),
        force_N=reader.number(keys.get("force"), "force_N"),
        temperature_degC=reader.pair(keys.get("temperature"), "temperature_degC"),
        speed_mm_per_s=reader.number(keys.get("speed"), "speed_mm_per_s"),
        limits=reader.limits(),
    )
    if reader.problems:
        raise CompdError(reader.problems)
    return request


def field_of(problem: Problem) -> str:
    """The field of the form that a problem concerns; "" for none."""
    if problem.where.startswith("limit of "):
        return problem.where
    name = problem.where.partition(",")[0]
    return _FIELDS.get(name, name.partition("_")[0] if name in _NAMES else "")


_NAMES = ("rivals", "beside", "rows", "force_N", "speed_mm_per_s")


class _Reader:
    """Reads values of any type; adds faults to `problems`."""

    def __init__(self, keys: Mapping[str, Any], known: Collection[str]) -> None:
        self._keys, self._known = keys, known
        self.problems: list[Problem] = []

    def effects(self, key: str) -> list[str]:
        names = self._keys.get(key, [])
        if not isinstance(names, list) or len(names) > _MAX_RIVALS:
            self._add(key, str(names)[:80], f"a list of at most {_MAX_RIVALS} ids")
            return []
        unknown = [str(name)[:80] for name in names if not isinstance(name, str) or name not in self._known]
        if unknown:
            self._add(key, ", ".join(unknown), "effects of the library, and saved ones of one's own")
        return [] if unknown else list(names)

    def rows(self) -> int:
        rows = self._keys.get("rows")
        if type(rows) is int and MIN_ROWS <= rows <= MAX_ROWS:
            return rows
        self._add("rows", str(rows)[:80], f"{MIN_ROWS} to {MAX_ROWS}")
        return MIN_ROWS

    def number(self, value: object, where: str) -> float | None:
        if value is None:
            return None
        if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < math.inf:
            try:
                return float(value)
            except OverflowError:
                pass
        self._add(where, str(value)[:80], "a number")
        return None

    def pair(self, value: object, where: str) -> Range | None:
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != 2 or None in value:
            self._add(where, str(value)[:80], "two numbers, low before high")
            return None
        low, high = (self.number(end, where) for end in value)
        return None if low is None or high is None else (low, high)

    def workspace(self) -> tuple[Range, Range, Range] | None:
        value = self._keys.get("workspace")
        if value is None:
            return None
        if not isinstance(value, list) or len(value) != 3:
            self._add("workspace_M_mm", str(value)[:80], "three pairs: x, y, z")
            return None
        x, y, z = (self.pair(pair, f"workspace_M_mm, {axis}") for axis, pair in zip("xyz", value, strict=True))
        return None if x is None or y is None or z is None else (x, y, z)

    def limits(self) -> dict[str, Range]:
        value = self._keys.get("limits") or {}
        if not isinstance(value, dict):
            self._add("limits", str(value)[:80], "pairs by column")
            return {}
        pairs = {name: self.pair(pair, f"limit of {name}") for name, pair in value.items()}
        return {name: pair for name, pair in pairs.items() if pair is not None}

    def _add(self, where: str, value: str, allowed: str) -> None:
        self.problems.append(Problem(where, "is not understood", value=value, allowed=allowed))


def _text(*values: float) -> str:
    """Numbers in the form of an option, with all digits."""
    return ",".join(str(int(value)) if value.is_integer() else repr(value) for value in values)
