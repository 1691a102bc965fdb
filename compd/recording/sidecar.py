"""The sidecar NAME.yaml of a recording: the machine, the reference, and the rows that a person excluded."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, get_args

import yaml
from pydantic import BeforeValidator, Field, WithJsonSchema, field_validator, model_validator

from compd.documents import Document, Section, read_document, refusal, unknown_key, validate
from compd.errors import ConfigurationError, Problem, RecordingError
from compd.files import FileKind
from compd.recording.reference import Quantity, Reference
from compd.units import REFERENCE_UNITS

# Format written by this release. Format 1, of release 0.1, has no `format:`; neither 1 nor 2 has `quantities_at_zero`.
FORMAT = 3
EXTERNAL = "external"
# Groups that cross-validation may leave out as a whole, besides the values of a column.
TIME, PLACE = "time", "place"

_EXCLUSION = "- {row: 17, reason: the tracker's beam was cut}"
_EXAMPLE = (
    "machine: tripod-cmm, or `machine: external` for columns model_... of a model of your own; under it reference: "
    "{quantity: tool_position, frame: machine}"
)
# Row 1 is the header.
_FIRST_ROW = 2


def _row_numbers(value: Any) -> tuple[int, ...]:
    """17 -> (17,); [17, 20] -> both; "17-20" -> four rows."""
    rows: list[Any] = value if isinstance(value, list) else [value]
    if isinstance(value, str) and (match := re.fullmatch(r"(\d+)\s*-\s*(\d+)", value)):
        rows = list(range(int(match[1]), int(match[2]) + 1))
    numbers = [row for row in rows if isinstance(row, int) and not isinstance(row, bool) and row >= _FIRST_ROW]
    if not rows or len(numbers) != len(rows):
        raise refusal(
            "names no row",
            f"rows as a spreadsheet shows them (header = row 1): {_EXCLUSION}",
            "give the row's number",
        )
    return tuple(numbers)


_ROW_SCHEMA = {"type": "integer"}
RowNumbers = Annotated[
    tuple[int, ...],
    BeforeValidator(_row_numbers),
    WithJsonSchema({"anyOf": [_ROW_SCHEMA, {"type": "array", "items": _ROW_SCHEMA}, {"type": "string"}]}),
]


class Exclusion(Section):
    """Rows left out, with reason: `{row: 17, reason: ...}`, `{rows: [17, 20], ...}`, `{rows: 17-20, ...}`."""

    row: RowNumbers = Field(default=(), description="the row as a spreadsheet shows it; the header is row 1")
    rows: RowNumbers = Field(default=(), description="several rows: a list, or `17-20` for the first to the last")
    reason: str = Field(default="", validate_default=True, description="why they are left out; it must be written")

    @model_validator(mode="before")
    @classmethod
    def _mapping_with_rows(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            raise refusal("has no reason", _EXCLUSION, "say why the row is left out")
        # neither key: a missing row is reported like a wrong one
        return data if "row" in data or "rows" in data else {**data, "row": None}

    @field_validator("reason", mode="before")
    @classmethod
    def _stated_reason(cls, reason: Any) -> str:
        text = str(reason or "").strip()
        if not text:
            raise refusal("is missing", _EXCLUSION, "say why the row is left out")
        return str(reason)


def _checked_format(value: Any) -> int:
    if value is None:
        return 1
    if not isinstance(value, int) or isinstance(value, bool) or value < 1:
        raise refusal("is no format number", f"1 to {FORMAT}", f"write `format: {FORMAT}`, or leave it out")
    return value


def _checked_machine(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise refusal(
            "names no machine",
            "the name of a machine configuration, or `external`",
            "write `machine: tripod-cmm`",
        )
    return value


def _checked_exclusions(value: Any) -> Any:
    if value is not None and not isinstance(value, list):
        raise refusal("must be a list", _EXCLUSION, "write one entry per reason")
    return value or []


def _checked_folds(value: Any) -> tuple[str, ...]:
    names = value if isinstance(value, list) else [] if value is None else [value]
    if not all(isinstance(name, str) and name for name in names) or value == []:
        raise refusal(
            "names nothing to leave out",
            f"{TIME}, {PLACE}, or the name of a column; or a list of them",
            f"write `folds: {PLACE}`, or leave it out",
        )
    return tuple(dict.fromkeys(names))


def _checked_quantities(value: Any) -> dict[str, float] | None:
    if value is None:
        return None
    if not isinstance(value, dict) or not all(
        isinstance(name, str)
        and isinstance(number, int | float)
        and not isinstance(number, bool)
        and math.isfinite(number)
        for name, number in value.items()
    ):
        raise refusal(
            "is no mapping of quantities to numbers",
            "temperature_link_1_degC: 20.31",
            "write each under the name of its column, which has the unit",
        )
    return {name: float(number) for name, number in value.items()}


def _mapping_or_nothing(value: Any) -> Any:
    if value is not None and not isinstance(value, dict):
        raise refusal("is of the wrong kind", "`key: value` lines")
    return value or {}


def _text_or_nothing(value: Any) -> Any:
    if value is not None and not isinstance(value, str):
        raise refusal("is of the wrong kind", "text")
    return value or ""


SECTIONS: Mapping[str, Any] = {
    "format": Annotated[
        int,
        BeforeValidator(_checked_format),
        Field(description=f"number of the format: {FORMAT}; a sidecar without it counts as 1, of release 0.1"),
    ],
    "machine": Annotated[
        str,
        BeforeValidator(_checked_machine),
        Field(description=f"name of the machine's configuration, or `{EXTERNAL}` with your own model's prediction"),
    ],
    "machine_file": Annotated[
        str,
        BeforeValidator(_text_or_nothing),
        Field(
            description="the machine's configuration, as a path from the sidecar's directory; left out for a machine "
            "that comes with compd, and where `--machine` names it. `compd recording join --machine FILE` and "
            "`compd recording start --daemon FILE.yaml` write it"
        ),
    ],
    "reference": Annotated[
        Reference | None, Field(description="what the reference instrument measured; left out where there was none")
    ],
    "folds": Annotated[
        str | tuple[str, ...],
        BeforeValidator(_checked_folds),
        Field(
            description=f"what cross-validation leaves out as a whole, one of these or a list: `{TIME}`, sessions or "
            f"blocks of time; `{PLACE}`, sectors of the workspace; the name of a column, each of its values, or eight "
            f"classes of a quantity with many values. Without the key `{TIME}`, and `{PLACE}` where it is known"
        ),
    ],
    "quantities_at_zero": Annotated[
        dict[str, float] | None,
        BeforeValidator(_checked_quantities),
        Field(
            description="temperatures, forces and so on when machine zero was taken, by the names of their columns: "
            "from them effects count. Without the key, as in recordings of releases up to 0.2, they count from "
            "20 degC, 1013.25 hPa and 0 of anything else"
        ),
    ],
    "excluded_rows": Annotated[
        tuple[Exclusion, ...],
        BeforeValidator(_checked_exclusions),
        Field(description="rows that a person left out, each with the reason"),
    ],
    "trusted_rows": Annotated[
        tuple[Exclusion, ...],
        BeforeValidator(_checked_exclusions),
        Field(
            description="rows that a person vouches for, each with the reason, in the same form: they count, whatever "
            "looks wrong in them"
        ),
    ],
    "provenance": Annotated[
        dict[Any, Any],
        BeforeValidator(_mapping_or_nothing),
        Field(description="how the recording came to be; kept, and not interpreted"),
    ],
    "notes": Annotated[str, BeforeValidator(_text_or_nothing), Field(description="any text")],
}


SIDECAR = FileKind(
    "the sidecar of a recording",
    frozenset({"machine", "reference", "excluded_rows", "folds"}),
    least=1,
    others=frozenset(SECTIONS),
    next_step=f"write it: {_EXAMPLE}",
)


@dataclass(frozen=True)
class Sidecar:
    """A sidecar, checked by itself."""

    path: Path
    machine: str  #: name of a machine configuration, or "external"
    reference: Reference | None  #: None in a recording of gauges alone, to which `compd recording join` adds one
    excluded: Mapping[int, str] = field(default_factory=dict)  #: spreadsheet row (header = 1) -> the person's reason
    #: provenance, notes: how the recording came to be; kept, never interpreted
    provenance: Mapping[str, Any] = field(default_factory=dict)
    notes: str = ""
    format: int = FORMAT  #: number of the format that the file was written in
    #: what cross-validation leaves out: "time", "place" or columns; empty where the sidecar does not say
    folds: tuple[str, ...] = ()
    #: by name, from which effects count; None if the sidecar does not say
    quantities_at_zero: Mapping[str, float] | None = None
    #: spreadsheet row -> reason why it counts although it looks wrong
    trusted: Mapping[int, str] = field(default_factory=dict)
    machine_file: Path | None = None  #: the machine's configuration; None where the sidecar names none

    @property
    def external(self) -> bool:
        """The recording carries the user's own model's prediction."""
        return self.machine == EXTERNAL

    @property
    def counts_from(self) -> str:
        """Origin of measured quantities for effects, in words; "" for an external model, which uses plain values."""
        if self.external:
            return ""
        if self.quantities_at_zero is None:
            return "20 degC, 1013.25 hPa and 0 of other quantities: the sidecar has no `quantities_at_zero:`"
        return "machine zero"

    @property
    def unit(self) -> str:
        """Unit of the reference's errors: "um", or that of `reference.unit`."""
        return "um" if self.reference is None else self.reference.unit


def read_sidecar(path: Path, problems: list[Problem]) -> Sidecar | None:
    """Read a sidecar; faults go to `problems`. None for a missing or unreadable one.

    With problems the Sidecar has what could be read, so that the columns can be checked against it all the same.
    Raises RecordingError for a file of a newer format, in which nothing else can be judged.
    """
    if not path.is_file():
        problems.append(Problem(str(path), "the sidecar is missing", next_step=f"write it: {_EXAMPLE}"))
        return None
    try:
        document = read_document(path, SIDECAR)
    except ConfigurationError as error:
        problems += error.problems
        return None
    _refuse_newer_format(document)
    problems += [unknown_key(document, (key,), list(SECTIONS)) for key in document.data if key not in SECTIONS]
    sections = {key: validate(kind, document, (key,), problems) for key, kind in SECTIONS.items()}
    reference: Reference | None = sections["reference"]
    if reference is None:
        reference = _columns_alone(document)
    elif reference.unit != "um" and sections["machine"] not in (None, EXTERNAL):
        problems.append(
            Problem(
                document.where(("reference", "unit")),
                f"belongs to `machine: {EXTERNAL}`",
                value=reference.unit,
                allowed="um, or nothing",
                next_step="delete it, and give the columns in mm",
            )
        )
    elif reference.balls is not None:
        reference = reference.model_copy(update={"balls": path.parent / reference.balls})
    if sections["quantities_at_zero"] is not None and sections["machine"] == EXTERNAL:
        problems.append(
            Problem(
                document.where(("quantities_at_zero",)),
                "belongs to a machine with a machine zero; an external model's effects count as they are written",
                allowed=f"the name of a configuration, not `machine: {EXTERNAL}`",
                next_step="delete it",
            )
        )
    return Sidecar(
        path,
        sections["machine"] or "",
        reference,
        _reasons(sections["excluded_rows"]),
        sections["provenance"] or {},
        sections["notes"] or "",
        sections["format"] or FORMAT,
        sections["folds"] or (),
        sections["quantities_at_zero"],
        _reasons(sections["trusted_rows"]),
        path.parent / sections["machine_file"] if sections["machine_file"] else None,
    )


def _reasons(entries: Sequence[Exclusion] | None) -> dict[int, str]:
    """Row -> reason, of entries of `excluded_rows` or `trusted_rows`."""
    return {row: entry.reason for entry in entries or () for row in (*entry.row, *entry.rows)}


def sidecar_contents(
    machine: str,
    reference: Mapping[str, Any] | None = None,
    excluded: Mapping[int, str] | None = None,
    provenance: Mapping[str, Any] | None = None,
    notes: str = "",
    folds: Sequence[str] = (),
    quantities_at_zero: Mapping[str, float] | None = None,
    trusted: Mapping[int, str] | None = None,
    machine_file: Path | None = None,
) -> dict[str, Any]:
    """Contents of a sidecar as plain data, without keys that have no value.

    excluded, trusted : spreadsheet row -> reason, as `Sidecar.excluded`.
    machine_file : the machine's configuration; `sidecar_text` shortens it.
    """
    contents = {
        "machine": machine,
        "machine_file": "" if machine_file is None else str(machine_file.resolve()),
        "reference": reference,
        "folds": list(folds),
        "quantities_at_zero": None if quantities_at_zero is None else dict(quantities_at_zero),
        "excluded_rows": [{"row": row, "reason": reason} for row, reason in (excluded or {}).items()],
        "trusted_rows": [{"row": row, "reason": reason} for row, reason in (trusted or {}).items()],
        "provenance": provenance,
        "notes": notes,
    }
    return {
        key: value for key, value in contents.items() if value or (key == "quantities_at_zero" and value is not None)
    }


def sidecar_text(contents: Mapping[str, Any], directory: Path) -> str:
    """The text of a sidecar in `directory`, with the format's number first.

    A `machine_file` beside the sidecar or below becomes relative, so that both can be moved together, and the text
    tells nothing of the place. Elsewhere it stays an absolute path.
    """
    told = {"format": FORMAT, **contents}
    if (machine_file := Path(told.get("machine_file", ""))).is_relative_to(directory.resolve()):
        told["machine_file"] = machine_file.relative_to(directory.resolve()).as_posix()
    return yaml.safe_dump(told, sort_keys=False, allow_unicode=True)


def _refuse_newer_format(document: Document) -> None:
    value = document.value(("format",))
    if isinstance(value, int) and value > FORMAT:
        raise RecordingError.of(
            document.where(("format",)),
            "was written by a newer release of compd",
            value=str(value),
            allowed=f"1 to {FORMAT}",
            next_step="update compd on this computer, or export the recording with the older release",
        )


def _columns_alone(document: Document) -> Reference | None:
    """A faulty reference reduced to the parts that determine the columns; None for a faulty quantity."""
    quantity, unit = document.value(("reference", "quantity")), document.value(("reference", "unit"))
    if quantity not in get_args(Quantity):
        return None
    known_unit = unit if isinstance(unit, str) and unit in REFERENCE_UNITS else "um"
    return Reference.model_construct(quantity=quantity, unit=known_unit, frame="machine")
