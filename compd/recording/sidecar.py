"""The sidecar NAME.yaml of a recording: the machine, what the reference is, and the rows a person excluded."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from compd.configuration.document import Document, Location, read
from compd.errors import ConfigurationError, Problem

EXTERNAL = "external"
QUANTITIES = ("tool_position", "tool_pose", "link_length", "ball_plate")
FRAMES = ("machine", "instrument")
Quantity = Literal["tool_position", "tool_pose", "link_length", "ball_plate"]
Frame = Literal["machine", "instrument"]

_KEYS = ("machine", "reference", "excluded_rows", "provenance", "notes")
_REFERENCE_KEYS = ("quantity", "frame", "sigma_um", "balls")
_EXCLUSION_KEYS = ("row", "rows", "reason")
_EXCLUSION = "- {row: 17, reason: the tracker's beam was cut}"
_EXAMPLE = "machine: tripod-cmm, and under it reference: {quantity: tool_position, frame: machine}"


@dataclass(frozen=True)
class Reference:
    """What the reference instrument measured.

    Attributes
    ----------
    quantity : which columns hold it.
    frame : `machine`: in {M}; `instrument`: in the instrument's own frame, so that six registration
        parameters are always fitted. A ball plate's coordinates are its own: `instrument` unless said.
        A link's length has no frame: `machine`.
    sigma_um : standard uncertainty: one for every axis, or one for each; nan where nobody gave it.
    balls : the ball plate's file (ball_plate only).
    """

    quantity: Quantity
    frame: Frame
    sigma_um: tuple[float, ...] = (math.nan,)
    balls: Path | None = None


@dataclass(frozen=True)
class Sidecar:
    """A sidecar, checked by itself.

    Attributes
    ----------
    machine : name of a machine configuration, or "external".
    reference : None in a recording of gauges alone, to which `compd join` adds one.
    excluded : spreadsheet row (header = 1) -> the person's reason.
    provenance, notes : how the recording came to be; kept, never interpreted.
    """

    path: Path
    machine: str
    reference: Reference | None
    excluded: Mapping[int, str] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    notes: str = ""

    @property
    def external(self) -> bool:
        """The recording carries the user's own model's prediction."""
        return self.machine == EXTERNAL


def read_sidecar(path: Path, problems: list[Problem]) -> Sidecar | None:
    """Read a sidecar; what is wrong goes to `problems`. None where there is none that can be read."""
    if not path.is_file():
        problems.append(Problem(where=str(path), what="the sidecar is missing", next_step=f"write it: {_EXAMPLE}"))
        return None
    try:
        document = read(path)
    except ConfigurationError as error:
        problems += error.problems
        return None
    return _SidecarReader(document, problems).sidecar()


class _SidecarReader:
    """One pass over one document; every finding with its line."""

    def __init__(self, document: Document, problems: list[Problem]) -> None:
        self.document = document
        self.problems = problems

    def sidecar(self) -> Sidecar | None:
        data = self.document.data
        self._unknown((), data, _KEYS)
        machine = data.get("machine")
        if not isinstance(machine, str) or not machine:
            self._fault(
                ("machine",),
                "names no machine",
                "the name of a machine configuration, or `external`",
                "write `machine: tripod-cmm`",
            )
            machine = ""
        return Sidecar(
            self.document.path,
            machine,
            self._reference(data.get("reference")),
            self._excluded(data.get("excluded_rows")),
            self._typed("provenance", dict, {}, "`key: value` lines"),
            self._typed("notes", str, "", "text"),
        )

    def _reference(self, data: Any) -> Reference | None:
        if data is None:
            return None
        if not isinstance(data, dict):
            self._fault(("reference",), "must hold `quantity:` and what belongs to it", "", "see the format")
            return None
        self._unknown(("reference",), data, _REFERENCE_KEYS)
        quantity = data.get("quantity")
        if quantity not in QUANTITIES:
            self._fault(
                ("reference", "quantity"),
                "is missing" if quantity is None else "is unknown",
                ", ".join(QUANTITIES),
                "say what the instrument measured",
            )
            return None
        return Reference(quantity, self._frame(data, quantity), self._sigma(data), self._balls(data, quantity))

    def _frame(self, data: dict[str, Any], quantity: Quantity) -> Frame:
        frame = data.get("frame")
        if frame is None and quantity in ("link_length", "ball_plate"):
            return "instrument" if quantity == "ball_plate" else "machine"
        if frame not in FRAMES:
            self._fault(
                ("reference", "frame"),
                "is missing" if frame is None else "is unknown",
                ", ".join(FRAMES),
                "say in which frame the reference columns are",
            )
        elif quantity == "link_length" and frame == "instrument":
            self._fault(("reference", "frame"), "a link's length has no frame", "machine, or nothing", "delete it")
        return "instrument" if frame == "instrument" else "machine"

    def _sigma(self, data: dict[str, Any]) -> tuple[float, ...]:
        sigma = data.get("sigma_um")
        if sigma is None:
            return (math.nan,)
        each = sigma if isinstance(sigma, list) else [sigma]
        numbers = [
            float(s) for s in each if isinstance(s, int | float) and not isinstance(s, bool) and 0 < s < math.inf
        ]
        if not each or len(numbers) != len(each):
            self._fault(
                ("reference", "sigma_um"),
                "is no standard uncertainty",
                "a number greater than 0 in micrometres, or one for each axis: [0.1, 0.1, 0.3]",
                "leave it out where it is not known",
            )
            return (math.nan,)
        return tuple(numbers)

    def _balls(self, data: dict[str, Any], quantity: Quantity) -> Path | None:
        balls = data.get("balls")
        if quantity != "ball_plate":
            if balls is not None:
                self._fault(("reference", "balls"), f"belongs to ball_plate, not to {quantity}", "", "delete it")
            return None
        if not isinstance(balls, str) or not balls:
            self._fault(
                ("reference", "balls"),
                "is missing" if balls is None else "is no file name",
                "a CSV file: ball, x_mm, y_mm, z_mm",
                "name the plate's file, beside the sidecar",
            )
            return None
        return self.document.path.parent / balls

    def _excluded(self, data: Any) -> dict[int, str]:
        """Row -> reason from `{row: 17, reason: ...}`, `{rows: [17, 20], ...}` or `{rows: 17-20, ...}`."""
        excluded: dict[int, str] = {}
        if data is not None and not isinstance(data, list):
            self._fault(("excluded_rows",), "must be a list", _EXCLUSION, "write one entry per reason")
            return excluded
        for i, entry in enumerate(data or []):
            here: Location = ("excluded_rows", i)
            if not isinstance(entry, dict):
                self._fault(here, "has no reason", _EXCLUSION, "say why the row is left out")
                rows = _row_numbers(entry)
            else:
                self._unknown(here, entry, _EXCLUSION_KEYS)
                rows = _row_numbers(entry.get("rows", entry.get("row")))
                if not str(entry.get("reason") or "").strip():
                    self._fault((*here, "reason"), "is missing", _EXCLUSION, "say why the row is left out")
            if not rows or min(rows) < 2:
                self._fault(
                    here,
                    "names no row",
                    f"rows as a spreadsheet shows them (header = row 1): {_EXCLUSION}",
                    "give the row's number",
                )
            reason = entry.get("reason") if isinstance(entry, dict) else None
            excluded |= dict.fromkeys(rows, str(reason or "no reason given"))
        return excluded

    def _typed(self, key: str, kind: type[Any], default: Any, allowed: str) -> Any:
        value = self.document.data.get(key)
        if value is not None and not isinstance(value, kind):
            self._fault((key,), "is of the wrong kind", allowed)
            return default
        return default if value is None else value

    def _unknown(self, location: Location, data: dict[str, Any], allowed: tuple[str, ...]) -> None:
        for key in data:
            if key not in allowed:
                close = difflib.get_close_matches(str(key), allowed, n=1, cutoff=0.6)
                self._fault(
                    (*location, key),
                    "unknown key",
                    ", ".join(allowed),
                    f"did you mean `{close[0]}`?" if close else "remove it",
                )

    def _fault(self, location: Location, what: str, allowed: str = "", next_step: str = "") -> None:
        value = self.document.value(location)
        long = isinstance(value, dict | list) and len(str(value)) > 80
        shown = "" if value is None or long else repr(value)
        self.problems.append(
            Problem(where=self.document.where(location), what=what, value=shown, allowed=allowed, next_step=next_step)
        )


def _row_numbers(value: Any) -> list[int]:
    """17 -> [17]; [17, 20] -> both; "17-20" -> four rows; anything else -> []."""
    if isinstance(value, int) and not isinstance(value, bool):
        return [value]
    if isinstance(value, list) and all(isinstance(row, int) and not isinstance(row, bool) for row in value):
        return value
    if isinstance(value, str) and (match := re.fullmatch(r"(\d+)\s*-\s*(\d+)", value)):
        return list(range(int(match[1]), int(match[2]) + 1))
    return []
