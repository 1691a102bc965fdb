"""The model file as plain data: the keys of the YAML, read and checked, and written whole or not at all.

Each step keeps what it replaced, so that it can be undone. `compd.model_file.model_file` makes effects of the data.

    format: 3               # 1 and 2, of releases up to 0.2, have no `counts_from`, `fitted_range` and `checksum`
    machine: tripod-cmm     # name of the configuration, or "external"
    geometry: 9f3a...       # hash of the geometry that it was fitted on; left out where that is not known
    release: 0.2.0          # of compd, that wrote it
    effects:
    - effect: link_expansion  # an id, /absolute/file.py:NAME, or a formula written out
      counts_from: machine zero  # "20 degC" where it was fitted without the quantities there, and without the key
      shape: {}             # values of its nonlinear constants
      parameters:
      - {name: a, value: 11.0, std: 0.1, unit: ppm/K}
      plausible: {a: [0, 30]}  # only where a person means another range than the effect's own
    covariance: [[0.01]]    # of all fitted numbers jointly, in the order of the file
    fitted_range: {temperature_link_1_degC: [19.2, 24.6]}  # of each quantity that the effects read
    steps: []               # see ModelStep
    checksum: 5c1f...       # of all that is above
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import yaml
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from compd.documents import Finite, decode, parse_yaml, read_text
from compd.errors import ConfigurationError, Problem, StateError
from compd.files import CHECKSUM, FileKind, checksum_of, write_files
from compd.release import __version__
from compd.text import has_secret, holds_secret

FORMAT = 3
# By which a covariance may exceed what its variances allow: numbers are computed.
_ROUNDING = 1e-6
Kind = Literal["add", "remove", "fit", "undo"]
# An effect's id, /absolute/file.py:NAME, or a formula written out.
Declaration: TypeAlias = str | dict[str, Any]
# The parts of the file that a step replaces, as plain data.
State: TypeAlias = Mapping[str, Any]
NOTHING: State = {"effects": [], "covariance": []}


@dataclass(frozen=True)
class ModelStep:
    """One change of the model, as its ledger keeps it and as the model file has it."""

    kind: Annotated[Kind, Field(description="what was done")]
    effect: Annotated[str, Field(description='the effect that was added or removed; "" for a fit of all')]
    date: Annotated[str, Field(description="when, UTC, ISO 8601")]
    recording: Annotated[str, Field(description="the recording that it was fitted on")]
    sha256: Annotated[str, Field(description="hash of that recording with its sidecar")]
    rms_before_um: Annotated[float, Field(description="residual before, root mean square per coordinate, in `unit`")]
    rms_after_um: Annotated[float, Field(description="residual after, in `unit`")]
    noise_floor_um: Annotated[float, Field(description="noise floor of the recording, in `unit`")]
    replaced: Annotated[State, Field(description="`effects` and `covariance` as they were before, for undo")]
    undone: Annotated[bool, Field(description="whether a later step took it back")] = False
    unit: Annotated[str, Field(description="unit of the residual, the reference's in the recording's sidecar")] = "um"

    # for pydantic, which checks the steps of a file
    __pydantic_config__ = ConfigDict(extra="forbid", coerce_numbers_to_str=True)


@dataclass(frozen=True)
class StoredModel:
    """A model file as plain data: what can be shown and undone without the machine."""

    machine: str
    state: State = field(default_factory=lambda: NOTHING)
    steps: tuple[ModelStep, ...] = ()
    geometry: str = ""


def _covariance(rows: list[list[float]]) -> list[list[float]]:
    """ValueError for what is no covariance; nan stands for what is not known."""
    if any(len(row) != len(rows) for row in rows):
        raise ValueError("is no matrix of numbers: it has not as many rows as columns")
    for i, row in enumerate(rows):
        if row[i] < 0:
            raise ValueError(f"has a negative variance, {row[i]:g}: number {i + 1} of its diagonal")
        for k, value in enumerate(row[:i]):
            rounding = _ROUNDING * math.sqrt(row[i] * rows[k][k])
            if math.isinf(value) or abs(value - rows[k][i]) > rounding:
                raise ValueError(f"is not symmetric: {value:g} and {rows[k][i]:g} at {i + 1}, {k + 1}")
            if abs(value) > (1 + _ROUNDING) * math.sqrt(row[i] * rows[k][k]):
                raise ValueError(f"has a correlation beyond 1: {value:g} at {i + 1}, {k + 1}")
    return rows


def _standard_error(std: float) -> float:
    if std < 0:
        raise ValueError("is negative: a standard error is 0 or more, .nan where it is not known")
    return std


def _range(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] <= ends[1]:
        raise ValueError("is no range: [lowest, highest]")
    return ends


# A key without a value is an empty list or mapping.
_EmptyList = BeforeValidator(lambda value: [] if value is None else value)
_EmptyMapping = BeforeValidator(lambda value: {} if value is None else value)
_Range = Annotated[tuple[Finite, Finite], AfterValidator(_range)]


class FilePart(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, coerce_numbers_to_str=True)


class ParameterEntry(FilePart):
    """One fitted parameter."""

    name: str = Field(description="name of the parameter; b_1, b_2, ... where there is one for each link")
    value: float = Field(description="in its unit")
    std: Annotated[float, AfterValidator(_standard_error)] = Field(
        default=float("nan"), description="standard error, in the same unit; nan where it is not known"
    )
    unit: str = Field(default="", description="the unit, which must be the effect's")


class EffectEntry(FilePart):
    """One effect with its fitted parameters."""

    effect: Declaration = Field(description="an id of the library, /absolute/file.py:NAME, or a formula's declaration")
    counts_from: Literal["machine zero", "20 degC"] = Field(
        default="20 degC",
        description="the quantities from which it counts: `machine zero`; or `20 degC`, 1013.25 hPa and 0 of anything "
        "else, as in files of releases up to 0.2",
    )
    shape: Annotated[dict[str, float], _EmptyMapping] = Field(
        default={}, description="values of its nonlinear constants, by name"
    )
    parameters: list[ParameterEntry] = Field(description="its fitted parameters")
    plausible: Annotated[dict[str, _Range], _EmptyMapping] = Field(
        default={},
        description="lowest and highest plausible value of a parameter or constant, by its name, where a person means "
        "another range than the effect's: the daemon refuses a number beyond it",
    )


class ModelDocument(FilePart):
    """The keys of the file."""

    format: Annotated[int, Field(ge=1)] = Field(
        default=1, description=f"number of the format: {FORMAT}; 1 and 2, of releases up to 0.2, lack some keys"
    )
    machine: str = Field(description='name of the machine\'s configuration, or "external"')
    geometry: str = Field(
        default="",
        description="hash of the geometry that it was fitted on; on another one its parameters are of no use",
    )
    release: str = Field(default="", description="release of compd that wrote the file")
    effects: Annotated[list[EffectEntry], _EmptyList] = Field(default=[], description="the effects of the machine")
    covariance: Annotated[list[list[float]], _EmptyList, AfterValidator(_covariance)] = Field(
        default=[], description="covariance of all fitted parameters jointly, in the order of the file, one row a list"
    )
    fitted_range: Annotated[dict[str, _Range], _EmptyMapping] = Field(
        default={},
        description="lowest and highest value of each quantity that the effects read, in the rows that they were "
        "fitted to; beyond it the daemon computes with the nearer end",
    )
    steps: Annotated[list[ModelStep], _EmptyList] = Field(
        default=[], description="every step by which the model came to be, the last one last"
    )
    checksum: str = Field(
        default="",
        description="of all other keys; to change the file by hand, remove this line; its use then gives a warning",
    )


MODEL = FileKind(
    "a model file",
    frozenset({"machine", "effects"}),
    least=2,
    others=frozenset(ModelDocument.model_fields),
    next_step="`compd model add` writes one",
)


def read_stored(path: Path) -> StoredModel:
    """Read a model file without looking up its effects.

    Raises StateError with every problem: no such file, not YAML, a later format, keys that are missing, unknown or
    of the wrong kind.
    """
    _, stored = read_document(path)
    return stored


def read_document(path: Path, content: bytes | None = None) -> tuple[ModelDocument, StoredModel]:
    """Read a model file: the checked document, and the same with its effects as they were written.

    content : of the file, where it has been read already. Raises StateError as `read_stored` does.
    """
    where = str(path)
    try:
        text = read_text(path, f"{MODEL.name}; {MODEL.next_step}") if content is None else decode(content, path)
        data, _ = parse_yaml(text, path, MODEL, dumped=True)
    except ConfigurationError as error:
        raise StateError(error.problems) from error
    if isinstance(data.get("format"), int) and data["format"] > FORMAT:
        raise StateError.of(
            where,
            "was written by a later release of compd",
            value=f"format: {data['format']}",
            allowed=f"format: 1 to {FORMAT}",
            next_step=f"install release {data.get('release', 'that wrote it')} or later, or fit the effects anew",
        )
    try:
        document = ModelDocument.model_validate(data)
    except ValidationError as error:
        raise StateError([_problem(detail, where) for detail in error.errors(include_url=False)]) from error
    if document.checksum and document.checksum != (fitting := _checksum(data)):
        raise StateError.of(
            where,
            "was changed after it was written: its checksum does not fit",
            value=document.checksum,
            allowed=fitting,
            next_step="take it from a copy; where the change is meant, remove the line `checksum`",
        )
    state = {"effects": data.get("effects") or [], "covariance": data.get("covariance") or []}
    state |= {"fitted_range": data["fitted_range"]} if data.get("fitted_range") else {}
    return document, StoredModel(document.machine, state, tuple(document.steps), document.geometry)


def _checksum(data: Mapping[str, Any]) -> str:
    try:
        return checksum_of(data)
    except TypeError as error:
        return f"none: {error}"


def _problem(detail: ErrorDetails, where: str) -> Problem:
    """One of pydantic's errors, with the place as people count: `effects 2` is the second effect."""
    place = ""
    for part in detail["loc"]:
        if isinstance(part, int):
            place += f" {part + 1}"
        elif part not in ("str", "dict[str,any]"):  # pydantic's names for the two kinds of declaration
            place += f", {part}"
    top_level_keys = ", ".join(ModelDocument.model_fields) if len(detail["loc"]) == 1 else ""
    what, allowed = {
        "missing": ("is missing", ""),
        "extra_forbidden": ("is no key that belongs here", top_level_keys),
        "list_type": ("is no list", ""),
        "dict_type": ("is no mapping", ""),
        "model_type": ("is no mapping", ""),
        "dataclass_type": ("is no mapping", ""),
        "unexpected_keyword_argument": ("is no key that belongs here", ""),
        "string_type": ("is no text", ""),
        "float_type": ("is no number", ""),
        "float_parsing": ("is no number", ""),
        "literal_error": ("is none of the choices", str(detail.get("ctx", {}).get("expected", ""))),
    }.get(detail["type"], (detail["msg"].removeprefix("Value error, "), ""))
    return Problem(
        f"{where}{place}",
        what,
        value=_shown(detail),
        allowed=allowed,
        next_step="mend it, or take the file from a copy",
    )


def _shown(detail: ErrorDetails) -> str:
    """The value that is wrong; not that of an unknown key, which may be anything, nor a secret."""
    hidden = detail["type"] in ("missing", "extra_forbidden", "unexpected_keyword_argument")
    secret = holds_secret(detail["loc"]) or has_secret(detail["input"])
    return "" if hidden or secret else str(detail["input"])[:80]


class _DumperWithoutAliases(yaml.SafeDumper):
    """Writes a formula that stands in the model and in a step twice, and not as `&id001` and `*id001`."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def write_stored(path: Path, stored: StoredModel) -> None:
    """Write a model whole or not at all. Raises StateError where the disk refuses."""
    data = {
        "format": FORMAT,
        "machine": stored.machine,
        **({"geometry": stored.geometry} if stored.geometry else {}),
        "release": __version__,
        **stored.state,
        "steps": [_step_data(step) for step in stored.steps],
    }
    text = yaml.dump(
        data, Dumper=_DumperWithoutAliases, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110
    )
    written, _ = parse_yaml(text, path, MODEL, dumped=True)
    text += f'{CHECKSUM}: "{checksum_of(written)}"\n'
    try:
        # the daemon, another user, must be able to read it
        write_files({path: text}, mode=0o644)
    except OSError as error:
        raise StateError.of(
            str(path), f"cannot be written: {error.strerror}", next_step="choose a place that may be written"
        ) from error


def _step_data(step: ModelStep) -> dict[str, Any]:
    """A step as the file has it; the unit only where it is not um, which release 0.2.0 reads."""
    data = {**asdict(step), "replaced": dict(step.replaced)}
    if step.unit == "um":
        del data["unit"]
    return data
