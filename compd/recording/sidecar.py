"""The sidecar NAME.yaml of a recording: the machine, what the reference is, and the rows a person excluded."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import yaml
from pydantic import BeforeValidator, Field, ValidationInfo, WithJsonSchema, field_validator, model_validator

from compd.configuration.document import Document, read_document
from compd.configuration.section import Section, refusal, unknown_key, validate
from compd.errors import ConfigurationError, Problem, RecordingError

# What this release writes. Format 1, of release 0.1, has the same keys but no `format:`.
FORMAT = 2
EXTERNAL = "external"
Quantity = Literal["tool_position", "tool_pose", "link_length", "ball_plate"]
Frame = Literal["machine", "instrument"]

_SIGMA_SCHEMA = {"type": "number", "exclusiveMinimum": 0}
_EXCLUSION = "- {row: 17, reason: the tracker's beam was cut}"
_EXAMPLE = "machine: tripod-cmm, and under it reference: {quantity: tool_position, frame: machine}"
# Row 1 is the header.
_FIRST_ROW = 2


class Reference(Section):
    """What the reference instrument measured. An unknown `sigma_um` is nan; `balls` is relative to the sidecar."""

    quantity: Quantity = Field(
        description="what was measured: the tip, the tip and the attitude, the links' change, or balls of a ball plate"
    )
    frame: Frame = Field(
        default="machine",
        validate_default=True,
        description="machine: the coordinates are in {M}; instrument: in the instrument's own frame, so that a "
        "registration of six parameters is always fitted; of a ball plate always instrument unless it is written",
    )
    sigma_um: Annotated[
        tuple[float, ...],
        WithJsonSchema({"anyOf": [_SIGMA_SCHEMA, {"type": "array", "items": _SIGMA_SCHEMA}]}),
    ] = Field(
        default=(math.nan,),
        description="standard uncertainty of the reference, um: one number, or one for each axis; left out where it is "
        "not known",
    )
    balls: Path | None = Field(
        default=None,
        validate_default=True,
        description="ball_plate only: the ball plate's file, relative to the sidecar",
    )

    @field_validator("quantity", mode="before")
    @classmethod
    def _known_quantity(cls, quantity: Any) -> Any:
        return _one_of(quantity, get_args(Quantity), "say what the instrument measured")

    @model_validator(mode="before")
    @classmethod
    def _mapping(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            raise refusal("must hold `quantity:` and what belongs to it", next_step="see the format")
        # a key without a value is a missing key; the frame's default depends on the quantity
        return {"quantity": None, "frame": None, **{key: value for key, value in data.items() if value is not None}}

    @field_validator("frame", mode="before")
    @classmethod
    def _frame_of_the_quantity(cls, frame: Any, info: ValidationInfo) -> Any:
        quantity = info.data.get("quantity")
        if frame is None and quantity in ("link_length", "ball_plate"):
            return "instrument" if quantity == "ball_plate" else "machine"
        if quantity == "link_length" and frame == "instrument":
            raise refusal("a link's length has no frame", "machine, or nothing", "delete it")
        return _one_of(frame, get_args(Frame), "say in which frame the reference columns are")

    @field_validator("sigma_um", mode="before")
    @classmethod
    def _standard_uncertainties(cls, sigma: Any) -> Any:
        sigmas = sigma if isinstance(sigma, list) else [sigma]
        numbers = [value for value in sigmas if isinstance(value, int | float) and not isinstance(value, bool)]
        if not sigmas or len(numbers) != len(sigmas) or not all(0 < number < math.inf for number in numbers):
            raise refusal(
                "is no standard uncertainty",
                "a number greater than 0 in micrometres, or one for each axis: [0.1, 0.1, 0.3]",
                "leave it out where it is not known",
            )
        return tuple(numbers)

    @field_validator("balls", mode="before")
    @classmethod
    def _balls_of_a_ball_plate(cls, balls: Any, info: ValidationInfo) -> Any:
        quantity = info.data.get("quantity")
        if quantity == "ball_plate" and (not isinstance(balls, str) or not balls):
            raise refusal(
                "is missing" if balls is None else "is no file name",
                "a CSV file: ball, x_mm, y_mm, z_mm",
                "name the plate's file, beside the sidecar",
            )
        if quantity not in (None, "ball_plate") and balls is not None:
            raise refusal(f"belongs to ball_plate, not to {quantity}", next_step="delete it")
        return balls


def _one_of(value: Any, names: tuple[str, ...], next_step: str) -> Any:
    if value not in names:
        raise refusal("is missing" if value is None else "is unknown", ", ".join(names), next_step)
    return value


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
    """Rows that a person left out, and why: `{row: 17, reason: ...}`, `{rows: [17, 20], ...}`, `{rows: 17-20, ...}`."""

    row: RowNumbers = Field(default=(), description="the row as a spreadsheet shows it; the header is row 1")
    rows: RowNumbers = Field(default=(), description="several rows: a list, or `17-20` for the first to the last")
    reason: str = Field(default="", validate_default=True, description="why they are left out; it must be written")

    @model_validator(mode="before")
    @classmethod
    def _mapping_with_rows(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            raise refusal("has no reason", _EXCLUSION, "say why the row is left out")
        # neither key: the row that is missing is reported as a wrong one is
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
    "reference": Annotated[
        Reference | None, Field(description="what the reference instrument measured; left out where there was none")
    ],
    "excluded_rows": Annotated[
        tuple[Exclusion, ...],
        BeforeValidator(_checked_exclusions),
        Field(description="rows that a person left out, each with the reason"),
    ],
    "provenance": Annotated[
        dict[Any, Any],
        BeforeValidator(_mapping_or_nothing),
        Field(description="how the recording came to be; kept, and not interpreted"),
    ],
    "notes": Annotated[str, BeforeValidator(_text_or_nothing), Field(description="any text")],
}


@dataclass(frozen=True)
class Sidecar:
    """A sidecar, checked by itself.

    Attributes
    ----------
    machine : name of a machine configuration, or "external".
    reference : None in a recording of gauges alone, to which `compd join` adds one.
    excluded : spreadsheet row (header = 1) -> the person's reason.
    provenance, notes : how the recording came to be; kept, never interpreted.
    format : number of the format that the file was written in.
    """

    path: Path
    machine: str
    reference: Reference | None
    excluded: Mapping[int, str] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)
    notes: str = ""
    format: int = FORMAT

    @property
    def external(self) -> bool:
        """The recording carries the user's own model's prediction."""
        return self.machine == EXTERNAL


def read_sidecar(path: Path, problems: list[Problem]) -> Sidecar | None:
    """Read a sidecar; what is wrong goes to `problems`. None where there is none that can be read.

    With problems the Sidecar has what could be read, so that the columns can be checked against it all the same.
    Raises RecordingError for a file of a newer format, in which nothing else can be judged.
    """
    if not path.is_file():
        problems.append(Problem(where=str(path), what="the sidecar is missing", next_step=f"write it: {_EXAMPLE}"))
        return None
    try:
        document = read_document(path)
    except ConfigurationError as error:
        problems += error.problems
        return None
    _refuse_newer_format(document)
    problems += [unknown_key(document, (key,), list(SECTIONS)) for key in document.data if key not in SECTIONS]
    sections = {key: validate(kind, document, (key,), problems) for key, kind in SECTIONS.items()}
    reference = sections["reference"]
    if reference is None:
        reference = _quantity_alone(document)
    elif reference.balls is not None:
        reference = reference.model_copy(update={"balls": path.parent / reference.balls})
    exclusions: tuple[Exclusion, ...] = sections["excluded_rows"] or ()
    return Sidecar(
        path,
        sections["machine"] or "",
        reference,
        {row: exclusion.reason for exclusion in exclusions for row in (*exclusion.row, *exclusion.rows)},
        sections["provenance"] or {},
        sections["notes"] or "",
        sections["format"] or FORMAT,
    )


def sidecar_contents(
    machine: str,
    reference: Mapping[str, Any] | None = None,
    excluded: Mapping[int, str] | None = None,
    provenance: Mapping[str, Any] | None = None,
    notes: str = "",
) -> dict[str, Any]:
    """What a sidecar is to hold, as plain data; keys without a value are left out.

    excluded : spreadsheet row -> reason, as `Sidecar.excluded`.
    """
    contents = {
        "machine": machine,
        "reference": reference,
        "excluded_rows": [{"row": row, "reason": reason} for row, reason in (excluded or {}).items()],
        "provenance": provenance,
        "notes": notes,
    }
    return {key: value for key, value in contents.items() if value}


def sidecar_text(contents: Mapping[str, Any]) -> str:
    """The file's text, with the format's number first."""
    return yaml.safe_dump({"format": FORMAT, **contents}, sort_keys=False, allow_unicode=True)


def _refuse_newer_format(document: Document) -> None:
    value = document.value(("format",))
    if isinstance(value, int) and value > FORMAT:
        raise RecordingError(
            Problem(
                where=document.where(("format",)),
                what="was written by a newer release of compd",
                value=str(value),
                allowed=f"1 to {FORMAT}",
                next_step="update compd on this computer, or export the recording with the older release",
            )
        )


def _quantity_alone(document: Document) -> Reference | None:
    """A faulty reference reduced to its quantity, which says what columns there must be; None where that is faulty."""
    quantity = document.value(("reference", "quantity"))
    if quantity not in get_args(Quantity):
        return None
    return Reference.model_construct(quantity=quantity, frame="machine", sigma_um=(math.nan,), balls=None)
