"""The machine as built as a configuration: the drawing's file with other numbers, and a model file beside it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.built_machine.drawn_numbers import BuiltGeometry, built_geometry
from compd.configuration import Configuration, load
from compd.documents import Location, Value, read_text, with_values
from compd.errors import ConfigurationError
from compd.files import write_files
from compd.model.effects import FittedEffect
from compd.model_file import ModelFile
from compd.release import __version__

# How the comment beside a changed number begins.
REMARK = "drawing:"
_HEAD = "# The machine as built, by"
# What the first bytes of such a file contain.
BUILT_MARK = _HEAD.encode()
# Beyond three standard deviations a number is no matter of a tolerance.
_DEVIATIONS = 3.0
_MODEL_FILE: Location = ("state", "model_file")


class Provenance(NamedTuple):
    """Where the numbers come from.

    command : that found them, such as "compd calibrate".  date : ISO 8601, UTC.
    recordings : name and SHA-256 of each recording with its sidecar, as `Recording.sha256` has it.
    """

    command: str
    date: str
    recordings: tuple[tuple[str, str], ...]


class BuiltFiles(NamedTuple):
    """What was written.

    machine : the configuration.  model : the model file with the effects that no number of a drawing states, which the
    configuration names under `state: model_file`; None where there are none.
    geometry : the numbers that differ from the drawing's.
    """

    machine: Path
    model: Path | None
    geometry: BuiltGeometry


def write_built_machine(
    configuration: Configuration,
    fitted: Sequence[FittedEffect],
    covariance: FloatArray,
    provenance: Provenance,
    out: Path,
) -> BuiltFiles:
    """Write the machine as built: a configuration, with a model file beside it where one is needed.

    fitted : effects on the machine of the drawing.  covariance : (P, P) of all their numbers jointly.
    out : the configuration, NAME.yaml; the model file is NAME-model.yaml.

    The comments of the drawing's file stay. A number that changes has the drawing's beside it, in a comment.
    Raises ConfigurationError where the drawing's file cannot be read or its numbers cannot be replaced, or where `out`
    is that file; CompdError as `built_geometry` does.
    """
    drawing = configuration.path
    if out.resolve() == drawing.resolve():
        raise ConfigurationError.of(
            str(out),
            "is the file of the drawing",
            next_step="give the machine as built another name: the drawing's numbers are needed again",
        )
    built = built_geometry(configuration, fitted)
    model_file = out.with_name(f"{out.stem}-model.yaml") if built.others else None
    text = _with_provenance(_numbered(configuration, built), drawing, provenance, model_file)
    if model_file is not None:
        text = with_values(text, out, {_MODEL_FILE: str(model_file.resolve())})
    write_files({out: text})
    if model_file is not None:
        _model(load(out), fitted, covariance, built.others).write(model_file)
    return BuiltFiles(out, model_file, built)


def _numbered(configuration: Configuration, built: BuiltGeometry) -> str:
    """The drawing's text with the numbers of the machine as built."""
    drawing = configuration.path
    text = read_text(drawing, "a machine's configuration")
    stated = configuration.document
    assert stated is not None, "of a file that was loaded"
    numbers: dict[Location, Value] = {
        location: value for location, value in built.numbers.items() if not _same(stated.value(location), value)
    }
    return with_values(text, drawing, numbers, REMARK)


def _same(stated: object, value: Value) -> bool:
    """Whether a file states this number already; a key that it leaves out states zeros."""
    numbers = np.zeros(np.shape(value)) if stated is None else np.asarray(stated, dtype=np.float64)
    return bool(np.array_equal(numbers, np.asarray(value, dtype=np.float64)))


def _with_provenance(text: str, drawing: Path, provenance: Provenance, model_file: Path | None) -> str:
    """The text with where its numbers come from, below the comment with which it begins."""
    said = [
        f"{_HEAD} `{provenance.command}` of compd {__version__}, {provenance.date}.",
        f"# Drawing: {drawing.name}; its number stands beside each that differs, after `{REMARK}`.",
        *(f"# Recording: {name}, sha256 {sha256}" for name, sha256 in provenance.recordings),
    ]
    if model_file is not None:
        said.append(f"# What no number here states, such as gains, is in {model_file.name}.")
    begin = re.match(r"(?:#[^\n]*\n)*", text)
    end = begin.end() if begin else 0
    return f"{text[:end]}{'#' + chr(10) if end else ''}{chr(10).join(said)}\n{text[end:]}"


def _model(
    machine: Configuration, fitted: Sequence[FittedEffect], covariance: FloatArray, kept: Sequence[int]
) -> ModelFile:
    """The model file of the effects `kept`."""
    ends = np.cumsum([0, *(len(one.theta) for one in fitted)])
    columns = np.concatenate([np.arange(ends[i], ends[i + 1]) for i in kept])
    effects = tuple(fitted[i] for i in kept)
    return ModelFile(
        machine.machine,
        machine.geometry.links,
        tuple(one.effect.id for one in effects),
        effects,
        np.asarray(covariance)[np.ix_(columns, columns)],
        geometry=machine.geometry_hash,
        plausible={one.effect.id: _plausible(one, machine.geometry.links) for one in effects},
    )


def _plausible(fitted: FittedEffect, links: int) -> dict[str, tuple[float, float]]:
    """Ranges of an effect's numbers by their names: of a tolerance, which is a standard deviation, three times."""
    return {
        column.name: (_DEVIATIONS * column.parameter.low, _DEVIATIONS * column.parameter.high)
        for column in fitted.effect.columns(links)
        if column.parameter.rough
    }
