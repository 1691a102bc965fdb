"""A machine's model: its effects with their fitted numbers, and the ledger of how they came to be.

`compd.model_file.model_document` has the keys of the file that a model is kept in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray
from compd.errors import CompdError, Problem
from compd.model.effects import FittedEffect, is_measured
from compd.model.external import ExternalPrediction, Kinematics, new_external_model, predict_external
from compd.model_file.model_document import (
    Declaration,
    ModelStep,
    State,
    StoredModel,
    write_stored,
)
from compd.recording import EXTERNAL
from compd.result_tables import Columns, data_frame, html_table

if TYPE_CHECKING:
    import pandas as pd

# Lowest and highest value.
Range: TypeAlias = tuple[float, float]


@dataclass(frozen=True)
class EffectNumber:
    """One number of an effect, in the unit that people read.

    Attributes
    ----------
    effect : str
        Id of the effect.
    parameter : str
        Name of the parameter; with ``_1``, ``_x`` where there is one per link or axis.
    value : float
        Its value, in `unit`.
    standard_error : float
        In `unit`; nan where it is not known.
    unit : str
        For instance ``"ppm/K"``.
    plausible_low : float
        Lower end of the plausible range, in `unit`.
    plausible_high : float
        Upper end of the plausible range, in `unit`.
    searched : bool
        A nonlinear constant, which was searched and has no standard error.
    """

    effect: str
    parameter: str
    value: float
    standard_error: float
    unit: str
    plausible_low: float
    plausible_high: float
    searched: bool

    @property
    def undetermined(self) -> bool:
        """Whether its standard error is larger than the plausible range; not where it is not known."""
        return self.standard_error > self.plausible_high - self.plausible_low

    @property
    def plausible(self) -> bool:
        """Whether it lies in the plausible range."""
        return self.plausible_low <= self.value <= self.plausible_high


@dataclass(frozen=True, repr=False)
class ModelFile:
    """The effects that a machine's model has, with their fitted numbers, and the ledger of how they came to be.

    `open_model` reads one, `add_effect` begins one or adds to it, `write` keeps it. It is never changed in place.

    Attributes
    ----------
    machine : str
        Name of the machine's configuration, or ``"external"``.
    links : int
        Number of the machine's links; of an external model 0, or the number of links whose length it predicts.
    declared : tuple of str or dict
        Each effect as it was named: an id, ``/absolute/file.py:NAME``, or a formula written out.
    fitted : tuple of FittedEffect
        The same effects with their P fitted numbers.
    covariance : (P, P) array
        Of all fitted numbers jointly, in the order of `fitted`.
    steps : tuple of ModelStep
        The ledger: every change, with the recording it was fitted on and the error before and after.
    geometry : str
        Hash of the geometry that it was fitted on; ``""`` where that is not known.
    fitted_range : dict
        Lowest and highest value of each quantity that the effects read, in the rows that they were fitted to, by the
        quantity's name; empty where that is not known. Beyond it the daemon computes with the nearer end.
    plausible : dict
        Ranges that a person means in place of the effects' own, by the effect's id and the number's name.
    warnings : tuple of Problem
        What the file, as it was read, does not say of itself.
    """

    machine: str
    links: int
    declared: tuple[Declaration, ...] = ()
    fitted: tuple[FittedEffect, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    steps: tuple[ModelStep, ...] = ()
    geometry: str = ""
    fitted_range: Mapping[str, Range] = field(default_factory=dict)
    plausible: Mapping[str, Mapping[str, Range]] = field(default_factory=dict)
    warnings: tuple[Problem, ...] = ()

    def predict(
        self, rows: Mapping[str, ArrayLike] | pd.DataFrame, kinematics: Kinematics | None = None
    ) -> ExternalPrediction:
        """Where the tip is in rows of a machine with kinematics of your own, as the daemon computes it live.

        Parameters
        ----------
        rows : dict of arrays, or pandas.DataFrame
            Columns as of a recording: ``scale_1_mm`` ... (with `kinematics`), or the pose that was given,
            ``model_x_mm``, ``model_y_mm``, ``model_z_mm``; the quantities that the class and the effects need; and
            ``time_s``, without which rows count as one second apart.
        kinematics : Kinematics, optional
            An object of your class.

        Returns
        -------
        ExternalPrediction
            `tip_M_mm` and `rotation_M_rad`, with the effects; `tip_correction_mm` and `rotation_correction_rad`, what
            to add to a command; (N, 3) each, nan where it is not known.

        Raises
        ------
        CompdError
            Where a column is missing, the class gives no pose, or the model is of a machine that compd knows.
        """
        if self.machine != EXTERNAL:
            raise CompdError.of(
                "predict",
                "is of a machine that compd knows",
                value=self.machine,
                allowed=f"a model of `machine: {EXTERNAL}`",
                next_step="`compare` predicts the rows of its recordings",
            )
        names = list(map(str, rows))
        columns = {name: np.asarray(rows[name], dtype=np.float64) for name in names}
        links = next(i for i in count() if f"scale_{i + 1}_mm" not in columns)
        for fitted in self.fitted:
            if len(fitted.theta) != len(fitted.effect.columns(links)):
                raise CompdError.of(
                    f"effect {fitted.effect.id}",
                    "has numbers for another number of scales",
                    value=f"{links} columns scale_<i>_mm",
                    next_step="give the scales of the machine on which it was fitted",
                )
        model = new_external_model(kinematics, links)
        return predict_external(replace(model, effects=self.fitted, covariance=self.covariance), columns)

    def write(self, path: str | Path) -> None:
        """Write the model file (YAML), whole or not at all; an existing file is replaced.

        Parameters
        ----------
        path : str or Path
            Where to. `compd model adopt` takes the file into the running daemon.

        Raises
        ------
        StateError
            Where the disk refuses.
        """
        write_stored(Path(path), StoredModel(self.machine, self.state(), self.steps, self.geometry))

    def state(self) -> State:
        """The effects as plain data, for the file."""
        effects = [
            {
                "effect": declared if isinstance(declared, str) else dict(declared),
                **({"counts_from": fitted.effect.counts_from} if is_measured(fitted.effect) else {}),
                "shape": {name: float(value) for name, value in fitted.constants.items()},
                "parameters": estimates(fitted, self.links),
                **({"plausible": _lists(meant)} if (meant := self.plausible.get(fitted.effect.id)) else {}),
            }
            for declared, fitted in zip(self.declared, with_own_covariance(self.fitted, self.covariance), strict=True)
        ]
        ranges = {"fitted_range": _lists(self.fitted_range)} if self.fitted_range else {}
        return {"effects": effects, "covariance": self.covariance.tolist(), **ranges}

    def to_dataframe(self) -> pd.DataFrame:
        """One row per number of each effect, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            Columns `effect`, `parameter`; `value`, `standard_error`, `plausible_low` and `plausible_high`, all in
            `unit`; and `searched`, true for a nonlinear constant, which has no standard error: nan.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        return data_frame(self._columns())

    def _repr_html_(self) -> str:
        remarks = [
            f"{step.kind} {step.effect} on {step.recording}: "
            f"{step.rms_before_um:.3g} to {step.rms_after_um:.3g} {step.unit}" + (" (undone)" if step.undone else "")
            for step in self.steps
        ]
        return html_table(str(self), self._columns(), remarks)

    def __str__(self) -> str:
        names = ", ".join(fitted.effect.id for fitted in self.fitted) or "no effects"
        return f"Model of {self.machine}: {names}"

    def __repr__(self) -> str:
        return f"<{self}>"

    def numbers(self) -> list[EffectNumber]:
        """Every number of every effect: its parameters, then its searched nonlinear constants."""
        numbers: list[EffectNumber] = []
        for fitted in with_own_covariance(self.fitted, self.covariance):
            effect = fitted.effect
            meant = self.plausible.get(effect.id, {})
            for column, estimate in zip(effect.columns(self.links), estimates(fitted, self.links), strict=True):
                name, value, std, unit = estimate.values()
                low, high = meant.get(name, (column.parameter.low, column.parameter.high))
                numbers.append(EffectNumber(effect.id, name, value, std, unit, low, high, False))
            for constant in effect.constants:
                value, unit = float(fitted.constants[constant.name]), constant.unit
                low, high = meant.get(constant.name, (constant.low, constant.high))
                numbers.append(EffectNumber(effect.id, constant.name, value, np.nan, unit, low, high, True))
        return numbers

    def _columns(self) -> Columns:
        numbers = self.numbers()
        return {name: [getattr(number, name) for number in numbers] for name in EffectNumber.__dataclass_fields__}


def with_own_covariance(fitted: Sequence[FittedEffect], covariance: FloatArray) -> tuple[FittedEffect, ...]:
    """The effects, each with its block of the joint covariance."""
    ends = np.cumsum([0, *(len(effect.theta) for effect in fitted)])
    return tuple(
        replace(effect, covariance=covariance[begin:end, begin:end])
        for effect, begin, end in zip(fitted, ends[:-1], ends[1:], strict=True)
    )


def _lists(ranges: Mapping[str, Range]) -> dict[str, list[float]]:
    return {name: [float(low), float(high)] for name, (low, high) in ranges.items()}


def estimates(fitted: FittedEffect, links: int) -> list[dict[str, Any]]:
    """Each number as people read it: value, standard error, unit."""
    estimates = []
    for k, column in enumerate(fitted.effect.columns(links)):
        std = float(np.sqrt(fitted.covariance[k, k])) if k < len(fitted.covariance) else float("nan")
        value, value_std = column.parameter.from_theta(float(fitted.theta[k]), std)
        estimates.append(
            {"name": column.name, "value": float(value), "std": float(value_std), "unit": column.parameter.unit}
        )
    return estimates


def parameter_estimates(fitted: Sequence[FittedEffect], links: int) -> list[tuple[str, dict[str, Any]]]:
    """(effect id, {name, value, std, unit}) of every number."""
    return [(effect.effect.id, estimate) for effect in fitted for estimate in estimates(effect, links)]
