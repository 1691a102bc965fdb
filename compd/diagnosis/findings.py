"""What a diagnosis finds: effects with their numbers, rivals, descriptions, constants, gross rows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from compd.model.effects import Effect, FittedEffect, Parameter

Status = Literal["explains", "partial", "too_small", "no_gain", "not_testable"]


@dataclass(frozen=True)
class ParameterEstimate:
    """A fitted parameter in the unit that people read.

    Attributes
    ----------
    name : str
        As the effect's equation names it; with ``_1``, ``_x`` where there is one per link or axis.
    value : float
        The fitted value, in `unit`.
    std : float
        Its standard error, in `unit`.
    unit : str
        For instance ``"ppm/K"``.
    plausible : bool
        Whether the value may lie in the range that the effect declares as plausible, given its standard error.
    low, high : float
        That range, which reaches to nought, in `unit`.
    """

    name: str
    value: float
    std: float
    unit: str
    plausible: bool
    low: float = -math.inf
    high: float = math.inf

    @property
    def outside(self) -> bool:
        """Whether the value is outside the range by more than a standard error."""
        margin = 0.0 if math.isnan(self.std) else self.std
        return not self.low - margin <= self.value <= self.high + margin

    @property
    def determined(self) -> bool:
        """Whether the rows say more of it than its range: the standard error is less than the range is wide."""
        return self.std < self.high - self.low

    def as_json(self) -> dict[str, object]:
        """Keys of the verdict's `parameters`."""
        own = {"name": self.name, "value": self.value, "std": self.std, "unit": self.unit}
        return {**own, "plausible": self.plausible, "determined": self.determined}


@dataclass(frozen=True)
class Rival:
    """An effect that explains the recording as well as one that was found, in its place.

    Attributes
    ----------
    member : int
        Its place among the candidates.
    name : str
        Id of the effect.
    cosine : float
        Similarity with the found effect on these rows, 0 to 1.
    excess : float
        By how much more it leaves, in squares of the noise floor.
    std : float
        Standard error of the excess.
    """

    member: int
    name: str
    cosine: float
    excess: float
    std: float


@dataclass(frozen=True)
class NonlinearConstant:
    """A number that a description has beside its fitted parameters: a period, a lag, a knee.

    Attributes
    ----------
    covariate : str
        Whose term has it.
    name : str
        As the formula of that form names it: ``"period"``, ``"tau"`` of a lag, ``"knee"``, ``"start"`` of a step; of an
        effect, as its equation does.
    value : float
        In `unit`; it was searched and has no standard error.
    unit : str
        The covariate's, or ``"s"`` of a lag.
    """

    covariate: str
    name: str
    value: float
    unit: str

    def as_json(self) -> dict[str, object]:
        """Keys of one of a description's `constants`."""
        return {"covariate": self.covariate, "name": self.name, "value": self.value, "unit": self.unit}


@dataclass(frozen=True)
class EmpiricalFinding:
    """One covariate that the residual follows without a known cause.

    Attributes
    ----------
    covariate : str
        What the residual follows: the column of a quantity, ``"time"``, a link's length ...
    form : str
        Of the term that describes it best, for instance ``"linear"``.
    port : str
        Where in the machine the term acts.
    p_value : float
        Probability of so strong a term by noise alone, corrected for all that were tried.
    explained_fraction : float
        Share of what is above the noise that it explains on rows that were left out, 0 to 1.
    heldout_rms_um : float
        Error on rows that were left out with the term, um per coordinate.
    formula_effects : tuple of dict
        The term as formulas that `add_effect` and `compd model add` take, the largest direction first.
    parameters : tuple of dict
        Fitted values by name, one mapping for each of `formula_effects`.
    beside : tuple of str
        Other covariates that are needed along with it.
    effect : str
        Of a ``"change"``, the effect of the library that begins or changes; of a ``"proxy"``, the effect whose own
        temperature was not measured and that `covariate` stands for; ``""`` for every other form.
    time_s : float
        Of a ``"change"`` and a ``"step"``, when, on the recording's clock, s; nan for every other form.
    constants : tuple of NonlinearConstant
        The nonlinear constants of its terms, which the formulas have as numbers.
    """

    covariate: str
    form: str
    port: str
    p_value: float
    explained_fraction: float
    heldout_rms_um: float
    formula_effects: tuple[dict[str, Any], ...]
    parameters: tuple[dict[str, float], ...]
    beside: tuple[str, ...] = ()
    effect: str = ""
    time_s: float = math.nan
    constants: tuple[NonlinearConstant, ...] = ()

    @property
    def is_change(self) -> bool:
        """Whether something changed in the middle of the recording: an effect, or every row alike."""
        return self.form == "change" or (self.form == "step" and not self.beside)

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `depends_on`."""
        return {
            "covariate": self.covariate,
            "form": self.form,
            "port": self.port,
            "p_adjusted": self.p_value,
            "explained_fraction": self.explained_fraction,
            "heldout_rms_um": self.heldout_rms_um,
            "formula_effect": self.formula_effects[0] if self.formula_effects else None,
            "formula_effects": list(self.formula_effects),
            "fitted": list(self.parameters),
            "constants": [constant.as_json() for constant in self.constants],
            "beside": list(self.beside),
            **({"effect": self.effect} if self.effect else {}),
            **({"time_s": self.time_s} if math.isfinite(self.time_s) else {}),
            "note": "a description, not a cause",
        }


@dataclass(frozen=True, eq=False)
class DiagnosisStep:
    """One effect that was found.

    Attributes
    ----------
    fitted : FittedEffect
        The effect with its fitted numbers and searched constants.
    rivals : tuple of Rival
        Effects that explain as much, best first; empty where the recording tells it from all others.
    heldout_rms_um : float
        Error on rows that were left out, with it and those before it, um per coordinate.
    explained_fraction : float
        Share of what those before it left above the noise floor, 0 to 1.
    p_value : float
        Probability of so high a score by noise alone, corrected for all effects that were tried.
    parameters : tuple of ParameterEstimate
        Its numbers with standard errors.
    taken : float
        By how much it lowers the mean square on rows that were left out, beside those before it and not below the
        noise floor, in squares of that; nan where the noise is not known.
    """

    fitted: FittedEffect
    rivals: tuple[Rival, ...]
    heldout_rms_um: float
    explained_fraction: float
    p_value: float
    parameters: tuple[ParameterEstimate, ...]
    taken: float = math.nan

    @property
    def effect(self) -> Effect:
        """The effect without its parameters."""
        return self.fitted.effect

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `steps`."""
        return {
            "effect": self.effect.id,
            "rivals": [rival.name for rival in self.rivals],
            "heldout_rms_um": self.heldout_rms_um,
            "explained_fraction": self.explained_fraction,
            "p_adjusted": self.p_value,
            "parameters": [parameter.as_json() for parameter in self.parameters],
            "constants": dict(self.fitted.constants),
            "equation": self.effect.equation,
            "alike": {rival.name: rival.cosine for rival in self.rivals},
        }


@dataclass(frozen=True, eq=False)
class CandidateResult:
    """One effect of the library, tried alone; nan where it could not be tried.

    Attributes
    ----------
    effect : str
        Its id.
    status : str
        ``"explains"``, ``"partial"``, ``"too_small"``, ``"no_gain"`` or ``"not_testable"``. ``"too_small"``: its
        numbers are surely not nought, and what it takes of the error is less than an effect has to take.
    why : str
        The reason for the status, in words.
    heldout_rms_um : float
        Error on rows that were left out, with the effect alone, um per coordinate.
    explained_fraction : float
        Share of what is above the noise floor that it explains alone, 0 to 1; nan where the error is at the floor
        already and the effect takes too little for a name: a share of noise means nothing.
    p_value : float
        Probability of so high a score by noise alone, corrected for all effects that were tried.
    parameters : tuple of ParameterEstimate
        Its numbers with standard errors.
    """

    effect: str
    status: Status
    why: str
    heldout_rms_um: float = math.nan
    explained_fraction: float = math.nan
    p_value: float = math.nan
    parameters: tuple[ParameterEstimate, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `candidates`."""
        return {
            "effect": self.effect,
            "status": self.status,
            "why": self.why,
            "heldout_rms_um": self.heldout_rms_um,
            "explained_fraction": self.explained_fraction,
            "p_adjusted": self.p_value,
            "parameters": [parameter.as_json() for parameter in self.parameters],
        }


@dataclass(frozen=True)
class ImplausibleEffect:
    """An effect that would explain more than all that is named, with a number outside its plausible range."""

    effect: str  #: its id
    heldout_rms_um: float  #: error on rows that were left out, with the effect alone, um per coordinate
    explained_fraction: float  #: share of what is above the noise floor that it explains alone, 0 to 1
    number: ParameterEstimate  #: the one that exceeds its range the most
    parameter: Parameter  #: what the number is of, with the range and its source

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `asked`."""
        parameter = self.parameter
        return {
            "effect": self.effect,
            "heldout_rms_um": self.heldout_rms_um,
            "explained_fraction": self.explained_fraction,
            "number": self.number.as_json(),
            "parameter": parameter.name,
            "plausible": [parameter.low, parameter.high],
            "source": parameter.source,
        }


@dataclass(frozen=True)
class ConstantFinding:
    """A constant along the measured coordinates: the signature of every effect that moves all rows alike."""

    by_axis_um: Mapping[str, float]  #: the constant of each coordinate, um
    std_um: Mapping[str, float]  #: its standard error; nan where it is not known
    #: ids of effects that make nothing but a constant on these rows: any of them may be its cause
    effects: tuple[str, ...]
    separated_by: str = ""  #: what would part them, in words

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `constant`."""
        return {
            "um": dict(self.by_axis_um),
            "std_um": dict(self.std_um),
            "effects": list(self.effects),
            "separated_by": self.separated_by,
        }


@dataclass(frozen=True)
class UnknownStates:
    """A lag that was out of equilibrium when sessions began: its states there are fitted along, in every comparison."""

    effect: str  #: its id
    numbers: int  #: how many states are fitted
    before_um: float  #: error on rows that were left out with neither the states nor an effect, um per coordinate
    after_um: float  #: the same with the states

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict's `start`."""
        return asdict(self)


@dataclass(frozen=True)
class GrossRows:
    """Rows that neither noise nor anything that was found explains; they do not count."""

    rows: tuple[int, ...] = ()  #: as a spreadsheet shows them, rising
    #: (int, int): first and last row of each stretch in which most rows are gross: there something happened
    runs: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True)
class UntestedEffect:
    """An effect that cannot be tried on the recording, with the reason and what to measure."""

    effect: str  #: its id
    why: str  #: why it cannot be tried
    #: whether what was found could be this effect, seen through a quantity that goes along with its own
    likely: bool = False
