"""The models that the loop computes with: the one whose correction is applied, and one that runs beside it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.compensation import GaugeValues, WarmStart, compensate_cmm, compensate_machine_tool
from compd.errors import Problem, StateError
from compd.live.loop.wiring import MachineWires, WiredValues, Wires
from compd.model.effect import FittedEffect
from compd.model.effect_needs import needed_quantities, unmet_needs
from compd.model.machine import MachineModel
from compd.model.observations import available_settings
from compd.model_file import read_model_file
from compd.readings import Snapshot

_HASH_DIGITS = 16
# What a faulty effect of a person's own code raises.
_FAULTS = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)


@dataclass(frozen=True, eq=False)
class LiveModel:
    """A machine model, ready for the loop; frozen.

    file, hash : of its model file; "" without effects.
    needs : the wires of the quantities that its effects need, in the order of `quantities`.
    """

    machine: MachineModel
    file: str
    hash: str
    quantities: tuple[str, ...]
    needs: Wires

    def read(self, snapshot: Snapshot) -> WiredValues:
        """The quantities as they are now, in their own units."""
        return self.needs.read(snapshot, np.zeros(len(self.quantities)))

    def named(self, read: WiredValues) -> Mapping[str, FloatArray]:
        """The same by name."""
        return dict(zip(self.quantities, read.change_mm, strict=True))

    @property
    def summary(self) -> Mapping[str, Any]:
        """For MODEL and STATUS; what happens at the reference instrument is named as not live."""
        found: dict[str, Any] = {"effects": [one.effect.id for one in self.machine.live_effects]}
        if self.file:
            found |= {"model": self.hash, "file": self.file}
        if idle := [one.effect.id for one in self.machine.effects if not one.effect.live]:
            found["not_live"] = idle
        return found


class Models(NamedTuple):
    """What the loop adopts as one between two ticks. shadow : computed and published, never applied."""

    applied: LiveModel
    shadow: LiveModel | None = None

    @property
    def hashes(self) -> dict[str, str]:
        """For READINGS: of the model files; absent where there is none."""
        found = {"model": self.applied.hash} if self.applied.hash else {}
        return found if self.shadow is None else found | {"shadow": self.shadow.hash}

    @property
    def files(self) -> dict[str, str]:
        """For READINGS: where each model file was read, by its hash; for whoever must keep a copy."""
        return {model.hash: model.file for model in self if model is not None and model.hash}

    @property
    def summary(self) -> dict[str, Any]:
        """For MODEL and STATUS."""
        found: dict[str, Any] = {"applied": self.applied.summary}
        return found if self.shadow is None else found | {"shadow": self.shadow.summary}


class ModelLoader:
    """Reads model files for one machine, and refuses those that it cannot use live."""

    def __init__(self, bare: MachineModel, machine: str, geometry: str, wires: MachineWires) -> None:
        """`bare`: without effects; `machine`: the name in its configuration; `geometry`: the hash of its geometry."""
        self.bare = LiveModel(bare, "", "", (), wires.quantity_wires(()))
        self._machine = machine
        self._geometry = geometry
        self._wires = wires

    def read(self, path: Path) -> LiveModel:
        """The model in a file; every effect of it has what it needs.

        Raises CompdError with every problem: what `read_model_file` refuses, a gauge to add, an effect that fails.
        """
        before = _hash(path)
        bare = self.bare.machine
        file = read_model_file(path, self._machine, bare.links, self._geometry)
        if problems := [*self._unusable(file.fitted), *_misnamed(file.fitted)]:
            raise StateError(problems)
        machine = replace(bare, effects=file.fitted, covariance=file.covariance)
        names = dict.fromkeys(
            name for one in machine.live_effects for name in needed_quantities(one.effect, bare.links)
        )
        try_out(machine, tuple(names), str(path))
        if _hash(path) != before:
            raise StateError(Problem(where=str(path), what="has changed while it was read", next_step="ask again"))
        return LiveModel(machine, str(path), before, tuple(names), self._wires.quantity_wires(tuple(names)))

    def _unusable(self, fitted: tuple[FittedEffect, ...]) -> list[Problem]:
        """Live effects that lack a gauge, a setting or the recording's own clock."""
        bare = self.bare.machine
        assert bare.constants is not None
        available = {*self._wires.quantity_names, *available_settings(bare.constants)}
        live = [one for one in fitted if one.effect.live]
        problems = [problem for one in live for problem in unmet_needs(one.effect, available, bare.links)]
        return problems + [
            Problem(
                where=f"effect {one.effect.id}",
                what="reads time_s, which counts from the start of a recording",
                next_step="write it with what changes in that time, a temperature for instance",
            )
            for one in live
            if "time_s" in one.effect.symbols
        ]


def _misnamed(fitted: tuple[FittedEffect, ...]) -> list[Problem]:
    """Ids that could not be told apart among a correction's sources; numbers that are none."""
    ids = [one.effect.id for one in fitted]
    problems = [
        Problem(where=f"effect {name}", what="is in the model twice", next_step="remove one of them")
        for name in dict.fromkeys(ids)
        if ids.count(name) > 1
    ]
    problems += [
        Problem(
            where=f"effect {name}",
            what="has the name of a part of the correction",
            value=name,
            allowed="another id",
            next_step="rename it",
        )
        for name in ids
        if name in ("joints", "frame")
    ]
    return problems + [
        Problem(
            where=f"effect {one.effect.id}",
            what="has a parameter or constant that is not a finite number",
            next_step="fit it again with `compd effect fit`",
        )
        for one in fitted
        if not np.isfinite([*one.theta, *one.constants.values()]).all()
    ]


def try_out(machine: MachineModel, names: tuple[str, ...], where: str) -> None:
    """One cycle in each mode at machine zero with unknown quantities: a faulty effect fails here, not in the loop.

    Raises StateError.
    """
    unread = GaugeValues(
        np.zeros(machine.links),
        np.zeros(machine.joint_weights.shape[1]),
        np.zeros(9),
        dict.fromkeys(names, np.array(np.nan)),
        0.0,
    )
    target_mm = machine.arrangement.measured_tip_mm(machine.zero.contact)
    try:
        _, warm = compensate_cmm(machine, unread, WarmStart.at_zero(machine))
        compensate_machine_tool(machine, target_mm, None, unread._replace(time_s=1.0), warm)
    except _FAULTS as error:
        raise StateError(
            Problem(
                where=where, what=f"an effect fails: {type(error).__name__}: {error}", next_step="mend it, or remove it"
            )
        ) from error


def _hash(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:_HASH_DIGITS]
    except OSError as error:
        raise StateError(
            Problem(
                where=str(path),
                what=f"cannot be read: {error.strerror}",
                next_step="give the absolute path of a model file that the daemon's user may read",
            )
        ) from error
