"""Replay of a recording: every recorded cycle computed anew, and compared with the setpoint that was sent."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

from compd.columns import SKEW_COLUMN
from compd.configuration import Configuration
from compd.errors import RecordingError
from compd.kernel_versions import versions_text, versions_text_here
from compd.link_count import scale_count
from compd.live.loop import (
    CycleInputs,
    CycleSettings,
    CycleState,
    Pipeline,
    Setpoint,
    build_pipeline,
    stated_noise,
    step,
)
from compd.live.machine import LiveModel, Models
from compd.live.record.recording_part import CYCLES_SUFFIX, MODEL_MARK, ORDER
from compd.live.record.table_rows import Message
from compd.live.service import FORMER_TIP_NOISE, RecordedCycle, parse_readings
from compd.recording import ARROW, OpenPart
from compd.table_file import CSV, SUFFIXES, row_count

# What another order of the same additions changes: nine last bits of a length of 500 mm.
SAME_BY_ANOTHER_KERNEL_MM = 1e-12


class Agreement(StrEnum):
    """One of three. Each value is what `compd recording replay` says of it."""

    SAME = "the same to the last bit"
    ANOTHER_KERNEL = "within 1e-12 mm by another kernel"
    DIFFERENT = "different"


def agreement(sent: bytes, replayed: Setpoint, another_kernel: bool) -> Agreement:
    """How far the line that was sent agrees with the setpoint that is computed now.

    The line has rounded numbers. Each of them must be what a number within 1e-12 mm of the present one is rounded to,
    where another kernel made it; all else is the same.

    Parameters
    ----------
    another_kernel : whether the line was computed by other kernels, or by kernels that are not known.
    """
    if sent == replayed.to_json():
        return Agreement.SAME
    if not another_kernel:
        return Agreement.DIFFERENT
    low, high = (replayed.message(moved_mm) for moved_mm in (-SAME_BY_ANOTHER_KERNEL_MM, SAME_BY_ANOTHER_KERNEL_MM))
    return Agreement.ANOTHER_KERNEL if _is_between(json.loads(sent), low, high) else Agreement.DIFFERENT


def _is_between(sent: Any, low: Any, high: Any) -> bool:
    """Whether every number is between those of the same place, and all else is the same."""
    if isinstance(sent, dict) and isinstance(low, dict):
        return sent.keys() == low.keys() and all(_is_between(sent[key], low[key], high[key]) for key in sent)
    if isinstance(sent, list) and isinstance(low, list):
        return len(sent) == len(low) and all(map(_is_between, sent, low, high))
    if isinstance(sent, float) and isinstance(low, float):
        return bool(low <= sent <= high)
    return bool(isinstance(sent, bool) is isinstance(low, bool) and sent == low)


# Of a part's messages the first two say who spoke, and what the columns are.
_VERSION = "VERSION"
_FIRST_CLASSES = (_VERSION, "WATCH")
# The daemon writes the class first.
_ORDER_BEGINS = f'{{"class":"{ORDER}",'.encode()


class ReplayedCycle(NamedTuple):
    """One cycle of a recording, computed again.

    where : file and line of its READINGS message. tick : number of the cycle.
    sent, replayed : the SETPOINT line that was sent, and the one that is computed now.
    agreement : how far the two agree.
    computed_by : the release and the kernels that computed the first, as a text.
    """

    where: str
    tick: int
    sent: bytes
    replayed: bytes
    agreement: Agreement
    computed_by: str

    @property
    def differs(self) -> bool:
        return self.agreement is Agreement.DIFFERENT


class RecordedCycles:
    """The cycles in all parts of a recording, oldest first."""

    def __init__(self, name: Path) -> None:
        """`name`: as it was given to the recorder, for all parts; or that of one part, with or without a suffix.

        Raises RecordingError where there is no such recording.
        """
        stem = name.name.removesuffix(CYCLES_SUFFIX)
        for suffix in (*SUFFIXES, ARROW, ".yaml"):
            stem = stem.removesuffix(suffix)
        path = name.with_name(stem + CYCLES_SUFFIX)
        self.paths = [path] if path.is_file() else sorted(name.parent.glob(f"{stem}-[0-9]*{CYCLES_SUFFIX}"))
        self.torn_lines = 0  #: how many lines were cut off by a kill
        self.version: Message = {}  #: the VERSION message of the part that is being read; {} before the first
        #: the ORDER messages among the cycles that have been read: who ordered what meanwhile; none of daemons up to
        #: 0.3.0.
        self.orders: list[Message] = []
        if not self.paths:
            raise RecordingError.of(
                str(path),
                "is not there, nor parts of it",
                allowed=f"a recording by `compd recording start` (NAME-0001{CYCLES_SUFFIX} beside NAME-0001.csv)",
                next_step="give its name",
            )

    def config_hashes(self) -> set[str]:
        """Hashes of the configurations with which the parts were recorded."""
        first_messages = [next(self.messages(path), None) for path in self.paths]
        return {str(message.get("config_hash")) for _, message in filter(None, first_messages)}

    def model_files(self) -> list[Path]:
        """Copies of the model files beside the parts."""
        stems = [path.name.removesuffix(CYCLES_SUFFIX) for path in self.paths]
        return [
            copy
            for path, stem in zip(self.paths, stems, strict=True)
            for copy in sorted(path.parent.glob(f"{stem}{MODEL_MARK}*.yaml"))
        ]

    def cycles(self) -> Iterator[tuple[str, Message]]:
        """(file:line, READINGS message) of every cycle. An incomplete last line is left out and counted."""
        for path in self.paths:
            for where, message in self.messages(path):
                if message.get("class") == "READINGS":
                    yield where, message
                elif message.get("class") == _VERSION:
                    self.version = message
                elif message.get("class") == ORDER:
                    self.orders.append(message)

    def rows_without_cycle(self) -> dict[Path, int]:
        """How many rows of each part's table have no cycle from which they could be computed; only parts with such."""
        lacking = {}
        for path in self.paths:
            for suffix in (*SUFFIXES, ARROW):
                table = path.with_name(path.name.removesuffix(CYCLES_SUFFIX) + suffix)
                if not table.is_file():
                    continue
                rows = _rows(table)
                cycles = _whole_lines(path, but_for=_ORDER_BEGINS) - len(_FIRST_CLASSES)
                if rows > cycles:
                    lacking[table] = rows - cycles
        return lacking

    def messages(self, path: Path) -> Iterator[tuple[str, Message]]:
        """(file:line, message) of every line of a part; an incomplete last one is left out, and counted."""
        with path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                if not line.endswith(b"\n"):
                    self.torn_lines += 1
                    return
                where = f"{path}:{number}"
                try:
                    message = json.loads(line)
                except ValueError as error:
                    raise _damaged(where, str(error)) from error
                if not isinstance(message, dict):
                    raise _damaged(where, f"not an object but {type(message).__name__}")
                yield where, message


def replay_cycles(
    configuration: Configuration, recording: RecordedCycles, model_files: Sequence[Path] = ()
) -> Iterator[ReplayedCycle]:
    """Compute every recorded cycle again with `step`, from the state and the inputs in its READINGS message.

    Parameters
    ----------
    configuration : with which the daemon ran.
    recording : whose cycles to compute.
    model_files : applied or shadow models that are not beside the recording.

    Raises
    ------
    RecordingError
        A damaged line, readings of another machine, or a model file that is missing.
    StateError
        A model file that cannot be used.
    """
    pipeline = build_pipeline(configuration, configuration.gauge_objects())
    # without scales the correction is that of a pose, and has no links
    corrected = 0 if pipeline.settings.corrects_pose else scale_count(configuration.geometry.links)
    files = [*recording.model_files(), *model_files]
    read = [pipeline.loader.read(file, plausible=False) for file in files]
    models = {"": pipeline.loader.without_effects} | {model.hash: model for model in read}
    former = _former_settings(pipeline, configuration)
    here = versions_text_here()
    for where, message in recording.cycles():
        recorded = _recorded_cycle(where, message, pipeline.latest.channels, corrected)
        applied = _model(where, message.get("model", ""), models)
        shadow = _model(where, message["shadow"], models) if "shadow" in message else None
        used = Models(applied, shadow)
        # the recorded state is that after the models were adopted
        state, inputs = recorded.state._replace(models=used), recorded.inputs._replace(models=used)
        if FORMER_TIP_NOISE in message["carried"]:
            setpoint = _former_step(state, inputs, former)
        else:
            setpoint, _ = step(state, inputs, pipeline.settings)
        if SKEW_COLUMN not in message["setpoint"]:  # nor had the setpoints of releases up to 0.2.0
            setpoint = setpoint._replace(skew_s=math.nan)
        sent, line = recorded.setpoint_line, setpoint.to_json()
        computed_by = versions_text(recording.version.get("release"), recording.version.get("computed_by"))
        agrees = agreement(sent, setpoint, another_kernel=computed_by != here)
        yield ReplayedCycle(where, inputs.tick, sent, line, agrees, computed_by)


def _former_settings(pipeline: Pipeline, configuration: Configuration) -> CycleSettings:
    """As of releases up to 0.2.0: what they told of the tip's uncertainty was that by noise, and nothing limited it."""
    limits = pipeline.settings.limits.model_copy(update={"tip_error_um": None})
    noise = stated_noise(configuration, pipeline.wires, readings=1)
    return replace(pipeline.settings, limits=limits, noise=noise)


def _former_step(state: CycleState, inputs: CycleInputs, settings: CycleSettings) -> Setpoint:
    """The setpoint as these releases made it, with the tip's standard uncertainty along x, y, z."""
    setpoint, after = step(state, inputs, settings)
    if setpoint.values is None:
        return setpoint
    former_um = None if after.tip_noise_um is None else after.tip_noise_um[:3]
    return setpoint._replace(u_tip_um=former_um)


def _recorded_cycle(where: str, message: Message, channels: Sequence[str], links: int) -> RecordedCycle:
    """The cycle in a READINGS message. Raises RecordingError for a damaged message, or one of another machine."""
    try:
        if missing := [channel for channel in channels if channel not in message["readings"]]:
            raise RecordingError.of(
                where,
                f"has no reading of {', '.join(missing)}",
                next_step="give the configuration with which it was recorded",
            )
        recorded = parse_readings(message, channels)
        if links and len(recorded.state.correction_mm) != links:
            raise _damaged(where, f"is of a machine without {links} links")
    except (KeyError, TypeError, ValueError) as error:
        raise _damaged(where, f"{type(error).__name__}: {error}") from error
    return recorded


def _model(where: str, hash_: str, models: Mapping[str, LiveModel]) -> LiveModel:
    if hash_ not in models:
        raise RecordingError.of(
            where,
            "was computed with a model file that is not given",
            value=hash_,
            allowed=", ".join(filter(None, models)) or "none is given",
            next_step="give it with `--model`",
        )
    return models[hash_]


def _rows(table: Path) -> int:
    """Whole rows of a part's table."""
    if table.suffix == ARROW:
        return OpenPart(table).row_count
    return _whole_lines(table) - 1 if table.suffix == CSV else row_count(table)


def _whole_lines(path: Path, but_for: bytes | None = None) -> int:
    """but_for : lines that begin with it are not counted."""
    with path.open("rb") as file:
        return sum(line.endswith(b"\n") and not (but_for and line.startswith(but_for)) for line in file)


def _damaged(where: str, what: str) -> RecordingError:
    return RecordingError.of(
        where, f"is no READINGS message as the daemon sends it: {what}", next_step="restore the file"
    )
