"""Model files read for the loop: a model is applied, or runs beside the applied one as a shadow."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.documents import MAX_BYTES
from compd.errors import Problem, StateError
from compd.files import read_small_file
from compd.link_count import scale_count
from compd.live.machine.machine_zero import MachineZero
from compd.live.machine.wiring import Beyond, MachineWires, WiredValues, Wires
from compd.live.memory import Snapshot
from compd.model import MachineModel
from compd.model.effects import OWN_POSE, FittedEffect, available_settings, needed_quantities, unmet_needs
from compd.model.external import ExternalModel, OwnPose, known_live
from compd.model_file import ModelFile, Range, read_model_file
from compd.plugins import OWN_CODE, Code
from compd.recording import limit_of

_HASH_DIGITS = 16


class ModelText(NamedTuple):
    """A model file as it was read. A loop that takes over uses the same, whatever has become of the file.

    file : its path, or what a client calls it. content : its bytes.
    """

    file: str
    content: bytes

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a file. Raises StateError where it cannot be read, is no regular file, or has more than 1 MB."""
        try:
            return cls(str(path), read_small_file(path, MAX_BYTES))
        except OSError as error:
            raise StateError.of(
                str(path),
                f"cannot be read: {error.strerror or error}",
                next_step="give the absolute path of a model file that the daemon's user may read",
            ) from error

    @property
    def hash(self) -> str:
        """First digits of the SHA-256 of its content."""
        return hashlib.sha256(self.content).hexdigest()[:_HASH_DIGITS]


class FittedRanges(NamedTuple):
    """The range (k) of each quantity of a model in the recording that its effects were fitted on."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, names: Sequence[str], ranges: Mapping[str, Range]) -> Self | None:
        """Of these quantities; one without a range has no limits. None where no range is known."""
        known = [ranges.get(name, (-np.inf, np.inf)) for name in names]
        if not any(name in ranges for name in names):
            return None
        return cls(np.array([low for low, _ in known]), np.array([high for _, high in known]))

    def limited(self, read: WiredValues, names: Sequence[str]) -> WiredValues:
        """The values (k) that were read, those beyond at the nearer end of their range. names : theirs."""
        values = read.values
        within = np.minimum(np.maximum(values, self.low), self.high)
        if (within == values).all() or read.lost:
            return read._replace(values=within)
        indices = np.flatnonzero(within != values).tolist()
        text = ", ".join(
            f"{names[k]} is {values[k]:.6g}, fitted from {self.low[k]:.6g} to {self.high[k]:.6g}" for k in indices
        )
        by = {names[k]: abs(float(values[k] - within[k])) for k in indices}
        return read._replace(values=within, beyond=Beyond(text, by))


@dataclass(frozen=True, eq=False)
class LiveModel:
    """A machine model that can be used in the loop."""

    machine: MachineModel  #: with its effects
    quantities: tuple[str, ...]  #: names of the temperatures, forces and so on that its effects need
    wires: Wires  #: of these quantities, in the same order
    text: ModelText | None = None  #: its model file; None without effects
    #: in which each quantity was when the effects were fitted, in the same order; None where that is not known
    ranges: FittedRanges | None = None
    warnings: tuple[Problem, ...] = ()  #: what the file does not say of itself

    @cached_property
    def needed_at_zero(self) -> frozenset[str]:
        """Names of the quantities whose values at machine zero the effects need."""
        return self.machine.program.needed_at_zero

    def missing_at_zero(self, zero: MachineZero) -> str:
        """What machine zero lacks of `needed_at_zero`, and what to do, in a sentence; "" where it lacks nothing."""
        if self.needed_at_zero <= zero.quantities.keys():
            return ""
        missing = ", ".join(sorted(self.needed_at_zero - zero.quantities.keys()))
        return (
            f"machine zero of {zero.taken_at} has no {missing}, from which effects of the model count: bring the "
            "machine to its zero position and run `compd zero`"
        )

    @property
    def file(self) -> str:
        """Path of the model file; "" without effects."""
        return self.text.file if self.text else ""

    @cached_property
    def hash(self) -> str:
        """Hash of the model file; "" without effects. Every setpoint has it."""
        return self.text.hash if self.text else ""

    def read(self, snapshot: Snapshot) -> WiredValues:
        """The quantities in a snapshot, in their own units; one beyond the range of the fit is at its nearer end."""
        read = self.wires.read(snapshot, np.zeros(len(self.quantities)))
        return read if self.ranges is None else self.ranges.limited(read, self.quantities)

    def by_name(self, read: WiredValues) -> Mapping[str, FloatArray]:
        """What `read` returned, by name."""
        return dict(zip(self.quantities, read.values, strict=True))

    @property
    def summary(self) -> Mapping[str, Any]:
        """For MODEL and STATUS. `not_live` are effects at the reference instrument, which the machine does not need;
        `from_20_degC` those that were fitted without the quantities at machine zero, and do not count from there."""
        summary: dict[str, Any] = {"effects": [fitted.effect.id for fitted in self.machine.live_effects]}
        if self.file:
            summary |= {"model": self.hash, "file": self.file}
        live = set(summary["effects"])
        if not_live := [fitted.effect.id for fitted in self.machine.effects if fitted.effect.id not in live]:
            summary["not_live"] = not_live
        if self.warnings:
            summary["warnings"] = [
                " ".join(filter(None, (w.what, w.value))) + f": {w.next_step}" for w in self.warnings
            ]
        from_20_degC = [
            fitted.effect.id for fitted in self.machine.live_effects if fitted.effect.counts_from == "20 degC"
        ]
        if from_20_degC and not isinstance(self.machine, ExternalModel):  # its effects count as they are written
            summary["from_20_degC"] = from_20_degC
        return summary


def warn_of_datum(model: LiveModel, log: Any) -> None:
    """Log which effects of a model do not count from machine zero."""
    if effects := model.summary.get("from_20_degC"):
        log.warning("effects count from 20 degC and not from machine zero", file=model.file, effects=effects)


class ModelNames(NamedTuple):
    """Which models a cycle had, for READINGS.

    hashes : of the model files, by "model" and "shadow"; a key is absent where there is no file.
    files : path of each model file by its hash, for whoever keeps a copy.
    """

    hashes: Mapping[str, str]
    files: Mapping[str, str]


class Models(NamedTuple):
    """The models of one cycle: the corrections of `applied` are used, those of `shadow` only published."""

    applied: LiveModel
    shadow: LiveModel | None = None

    @property
    def names(self) -> ModelNames:
        """Hashes and files of the two."""
        hashes = {"model": self.applied.hash} if self.applied.hash else {}
        if self.shadow is not None:
            hashes["shadow"] = self.shadow.hash
        return ModelNames(hashes, {model.hash: model.file for model in self if model is not None and model.hash})

    @property
    def summary(self) -> dict[str, Any]:
        """For MODEL and STATUS."""
        summary: dict[str, Any] = {"applied": self.applied.summary}
        return summary if self.shadow is None else summary | {"shadow": self.shadow.summary}


class ModelLoader:
    """Reads model files for one machine, and refuses those that cannot be used live."""

    def __init__(
        self, model: MachineModel, machine: str, geometry: str, wires: MachineWires, code: Code = OWN_CODE
    ) -> None:
        """`model`: without effects; `machine`: the name in its configuration; `geometry`: the hash of its geometry;
        `code`: which Python files effects may be in."""
        # own kinematics needs its settings without effects, too
        settings = model.settings if isinstance(model, ExternalModel) else ()
        self.without_effects = LiveModel(model, settings, wires.quantity_wires(settings))
        self._machine = machine
        self._geometry = geometry
        self._wires = wires
        self._code = code

    def read(self, path: Path, plausible: bool = True) -> LiveModel:
        """The model in a file; `plausible` as of `load`.

        Raises CompdError with every problem: a file that cannot be read, what `read_model_file` refuses, gauges that
        the effects need and the machine does not have, an effect that fails.
        """
        return self.load(ModelText.read(path), plausible)

    def load(self, text: ModelText | None, plausible: bool = True) -> LiveModel:
        """The model in a file that has been read; None is the machine without effects. Raises as `read` does.

        plausible : whether to refuse what is not plausible. False for a recording, which is replayed with what it had.
        """
        if text is None:
            return self.without_effects
        model = self.without_effects.machine
        file = read_model_file(Path(text.file), self._machine, model.links, self._geometry, text.content, self._code)
        problems = [*self._unmet_needs(file.fitted), *_id_and_value_problems(file.fitted)]
        if plausible and not problems:
            problems = [*_implausible_numbers(file), *_implausible_ranges(file)]
        if problems:
            raise StateError(problems)
        machine = replace(model, effects=file.fitted, covariance=file.covariance)
        needed = (needed_quantities(fitted.effect, model.links) for fitted in machine.live_effects)
        names = tuple(dict.fromkeys(chain(self.without_effects.quantities, *needed)))
        try_model(machine, names, text.file)
        if isinstance(model, ExternalModel):  # its own kinematics gives the others, or an axis that stays still
            names = tuple(name for name in names if name in self._wires.quantity_names)
        # a setting is commanded, and has no range but its own
        fitted_range = {
            name: range_ for name, range_ in file.fitted_range.items() if name not in self.without_effects.quantities
        }
        ranges = FittedRanges.of(names, fitted_range)
        return LiveModel(machine, names, self._wires.quantity_wires(names), text, ranges, file.warnings)

    def _unmet_needs(self, effects: tuple[FittedEffect, ...]) -> list[Problem]:
        """Live effects that need a gauge or a setting which is not there, or the time since a recording's start."""
        model = self.without_effects.machine
        assert model.constants is not None
        available = {*self._wires.quantity_names, *available_settings(model.constants)}
        if isinstance(model, ExternalModel):
            available |= {OWN_POSE, *model.columns, *known_live(model.links)}
        live = replace(model, effects=effects).live_effects
        problems = [problem for fitted in live for problem in unmet_needs(fitted.effect, available, model.links)]
        return problems + [
            Problem(
                f"effect {fitted.effect.id}",
                "reads time_s, which counts from the start of a recording",
                next_step="write it with what changes in that time, a temperature for instance",
            )
            for fitted in live
            if "time_s" in fitted.effect.symbols
        ]


def _id_and_value_problems(effects: tuple[FittedEffect, ...]) -> list[Problem]:
    """Ids that cannot be told apart in `sources_mm` of a setpoint, and parameters that are not finite."""
    ids = [fitted.effect.id for fitted in effects]
    problems = [
        Problem(f"effect {name}", "is in the model twice", next_step="remove one of them")
        for name in dict.fromkeys(ids)
        if ids.count(name) > 1
    ]
    problems += [
        Problem(
            f"effect {name}",
            "has the name of a part of the correction",
            value=name,
            allowed="another id",
            next_step="rename it",
        )
        for name in ids
        if name in ("joints", "frame")
    ]
    return problems + [
        Problem(
            f"effect {fitted.effect.id}",
            "has a parameter or constant that is not a finite number",
            next_step="fit it again with `compd model fit`",
        )
        for fitted in effects
        if not np.isfinite([*fitted.theta, *fitted.constants.values()]).all()
    ]


def _implausible_numbers(file: ModelFile) -> list[Problem]:
    """Numbers beyond their plausible range, and those of effects of which the fit has determined none."""
    numbers = file.numbers()
    determined = {number.effect for number in numbers if not (number.undetermined or number.searched)}
    return [
        Problem(
            f"effect {number.effect}, {number.parameter}",
            "is not plausible",
            value=f"{number.value:g} {number.unit}, standard error {number.standard_error:g}",
            allowed=f"{number.plausible_low:g} to {number.plausible_high:g} {number.unit}, with a smaller error",
            next_step="fit it again with `compd model fit`; where it is meant, write the range under the effect: "
            f"`plausible: {{{number.parameter}: [LOW, HIGH]}}`, and remove the line `checksum`",
        )
        for number in numbers
        if not number.plausible or (number.undetermined and number.effect not in determined)
    ]


def _implausible_ranges(file: ModelFile) -> list[Problem]:
    """Quantities that were broken in the recording that the effects were fitted on."""
    limits = {name: limit for name in file.fitted_range if (limit := limit_of(name)) is not None}
    return [
        Problem(
            f"fitted_range, {name}",
            "was not plausible in the recording that the effects were fitted on",
            value=f"{file.fitted_range[name][0]:g} to {file.fitted_range[name][1]:g}",
            allowed=f"{limit.low:g} to {limit.high:g}: {limit.why}",
            next_step="leave these rows out of the recording, and fit it again with `compd model fit`",
        )
        for name, limit in limits.items()
        if not limit.low <= file.fitted_range[name][0] <= file.fitted_range[name][1] <= limit.high
    ]


def try_model(machine: MachineModel, names: tuple[str, ...], where: str) -> None:
    """Compute one cycle in each mode, at machine zero with quantities that are nan.

    A faulty effect of a user's own code then fails here and not in the loop. Raises StateError.

    names : of the quantities. where : the model file, for the message.
    """
    values = GaugeValues(
        np.zeros(scale_count(machine.links)),
        np.zeros(machine.joint_weights.shape[1]),
        np.zeros(9),
        dict.fromkeys(names, np.array(np.nan)),
        0.0,
        dict.fromkeys(names, np.nan),
    )
    target_mm: FloatArray = np.zeros(3)
    if isinstance(machine, ExternalModel):  # at a pose that is given, since the class may need real settings
        machine = replace(machine, own=None, given=OwnPose(np.zeros(3), np.zeros(3), np.zeros((6, machine.links))))
    else:
        target_mm = machine.arrangement.measured_tip_mm(machine.zero.contact)
    try:
        _, warm = compensate_cmm(machine, values, WarmStart.at_zero(machine))
        compensate_machine_tool(machine, target_mm, None, values._replace(time_s=1.0), warm)
    except (Exception, SystemExit) as error:  # an effect of a user's own code may do anything
        raise StateError.of(
            where, f"an effect fails: {type(error).__name__}: {error}", next_step="mend it, or remove it"
        ) from error
