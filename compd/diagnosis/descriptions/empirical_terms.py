"""Empirical terms: formula effects that describe what a residual follows, port x covariate x form; no causes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison import AlignedRecording
from compd.diagnosis.candidate_criteria import DescriptionCriteria
from compd.diagnosis.descriptions.search_covariates import (
    STAYED_THE_SAME,
    Kind,
    SearchCovariate,
    mirrored_predictions,
    round_middle,
    round_within,
    search_covariates,
    untried_quantities,
)
from compd.diagnosis.descriptions.term_formula import CONSTANTS, PARAMETERS, formula_text
from compd.diagnosis.descriptions.term_grids import ROUNDING, knees, periods, refined_periods, step_times_s
from compd.model.effects import Effect, Port, evaluate_basis
from compd.model.library import find_effect
from compd.statistics import PeriodCriteria
from compd.units import UM_PER_MM, unit_of

_LINK = re.compile(r"^(?P<what>[a-z][a-z0-9_]*)_link_(?P<link>\d+)_(?P<unit>[A-Za-z]\w*)$")

# In which forms a residual may follow a covariate beside linear: only what warms or wets a body arrives late, only
# along a way or an angle something repeats, and only under a load or in a workspace something stops and comes taut.
FORMS_BY_KIND: Mapping[Kind, tuple[str, ...]] = {
    "workspace": ("square", "knee", "periodic"),
    "place": ("square", "periodic"),
    "angle": ("square", "periodic"),
    "load": ("square", "knee"),
    "flow": ("square", "lagged"),
    "other": ("square",),
}
# A parabola needs three values of its covariate, a knee with two slopes four.
MIN_VALUES = {"square": 3, "knee": 4}
# Behind the residual's unit in a parameter's, by its name, {} for the covariate's; nothing where it is not here.
_PER_COVARIATE = {"k": "/{}", "m": "/{}", "k2": "/{}^2"}
_UNITS_OF_STRAIN = {"k": "ppm/{}", "c": "ppm"}
# Plausible range of a parameter of which nothing is known, in its unit; of a fitted one, times its size.
UNKNOWN_RANGE = 1e3
RANGE_PER_SIZE = 3
SOURCE = "describes a residual; its cause is not known"


# By covariate, form, middle, whether with a constant, and value of the nonlinear constant.
FactorsUm: TypeAlias = dict[tuple[str, str, float, bool, float | None], FloatArray]


@dataclass(frozen=True)
class EmpiricalTerm:
    """One formula of one covariate at one port.

    form : a key of FORMS.  middle : of the covariate, about which the formula is written.  span : of the covariate.
    per_link : whether each link has parameters of its own.
    axes : of a port that takes a vector, one effect each; ("",) for the links.
    with_constant : whether the formula has a constant of its own; none where every fit has one along each coordinate.
    grid : values of the nonlinear constant; empty for a form without one.
    residual_unit : in place of um.
    """

    covariate: str
    form: str
    port: str
    middle: float
    span: float
    per_link: bool = False
    axes: tuple[str, ...] = ("",)
    with_constant: bool = True
    grid: tuple[float, ...] = ()
    residual_unit: str = "um"

    @property
    def unit(self) -> str:
        """Unit of the covariate, from the end of its name; "1" for none."""
        return unit_of(self.covariate) or "1"

    @property
    def constant(self) -> str:
        """Name of the nonlinear constant, "" for none."""
        return CONSTANTS.get(self.form, "")

    @property
    def constant_unit(self) -> str:
        """Unit of the nonlinear constant: s of a lag, else the covariate's."""
        return "s" if self.form == "lagged" else self.unit

    def effect(self) -> Effect:
        """The formula as an effect, its constant a parameter; along the first axis where there are several."""
        return find_effect(self.declaration(self.axes[0]), "description")

    def constant_values(self, value: float | None) -> dict[str, float]:
        """The nonlinear constants of `effect`, by name, at a value of the term's; None for a term without one."""
        return {} if value is None else {self.constant: value}

    def columns_um(
        self, aligned: AlignedRecording, effect: Effect, value: float | None, factors_um: FactorsUm | None = None
    ) -> FloatArray:
        """(N, m, P) by how many um each parameter moves the prediction: all of the first axis, then of the next.

        effect : as from `effect`.  value : of the nonlinear constant; None for a term without one. The few empty cells
        of a covariate are filled.
        factors_um : what formulas make of their covariates, (N, P), as far as ports that take a vector have had them;
            the same formula at another port makes the same of them.
        """
        aligned, constants = aligned.gaps_filled, self.constant_values(value)
        if self.axes == ("",):
            return aligned.columns(effect, constants) * UM_PER_MM
        key = (self.covariate, self.form, self.middle, self.with_constant, value)
        known = {} if factors_um is None else factors_um
        if key not in known:
            basis, _ = evaluate_basis(effect, aligned.rows, constants, None)
            known[key] = basis[:, "xyz".index(self.axes[0])] * UM_PER_MM
        factors = known[key]
        along = self._measured_along_axes(aligned)
        return np.asarray((along[:, :, :, None] * factors[:, None, None, :]).reshape(*along.shape[:2], -1))

    def _measured_along_axes(self, aligned: AlignedRecording) -> FloatArray:
        """(N, m, axes) by how much the measured coordinates change per displacement of the port along each axis."""
        axes = ["xyz".index(axis) for axis in self.axes]
        if self.port == "reference" and aligned.model is None:
            shown = np.equal.outer(aligned.axes, axes).astype(np.float64)
            return aligned.along_ends(np.broadcast_to(shown, (len(aligned.rows), *shown.shape)))
        port: Port = "reference" if self.port == "reference" else "tool"
        return aligned.shown(aligned.sensitivity([port])[port])[:, :, axes]

    def declaration(
        self, axis: str, value: float | None = None, sizes: Mapping[str, float] | None = None
    ) -> dict[str, Any]:
        """The term as the declaration of a formula effect, as `compd model add` reads it.

        value : of the nonlinear constant, to be written into the formula; None leaves it a parameter.
        sizes : largest fitted size by parameter; the plausible range is RANGE_PER_SIZE times that.
        """
        formula = formula_text(self.form, self.covariate, self.middle, value, with_constant=self.with_constant)
        parameters: dict[str, Any] = {}
        for name in PARAMETERS:
            if not re.search(rf"\b{name}\b", formula):
                continue
            size = RANGE_PER_SIZE * abs((sizes or {}).get(name, 0.0)) or UNKNOWN_RANGE
            parameters[name] = {
                "unit": self._parameter_unit(name),
                "plausible": [-float(f"{size:.3g}"), float(f"{size:.3g}")],
                "source": SOURCE,
            }
            if self.per_link:
                parameters[name]["per"] = "link"
        if self.constant and value is None:
            plausible = list(self._constant_range())
            parameters[self.constant] = {"unit": self.constant_unit, "plausible": plausible, "source": SOURCE}
        return {
            "id": self._id(axis),
            "port": self.port,
            "formula": formula,
            **({"axis": axis} if axis else {}),
            "physics": "A description, not a cause: the residual follows this on the recordings that were looked at.",
            "parameters": parameters,
        }

    def _parameter_unit(self, name: str) -> str:
        """Unit of a fitted parameter: "um/degC", "ppm/degC" of a strain, "arcsec" of a constant."""
        if self.form == "strain":
            return _UNITS_OF_STRAIN[name].format(self.unit)
        per_covariate = "" if self.form == "step" else _PER_COVARIATE.get(name, "")
        return self.residual_unit + per_covariate.format(self.unit)

    def _id(self, axis: str) -> str:
        """Where and what: link_follows_humidity, z_follows_temperature_frame_lagged, tool_x_follows_force_y_square."""
        place = "_".join(part for part in ("" if self.port == "reference" else self.port, axis) if part)
        covariate = self.covariate.removesuffix(f"_{self.unit}")
        form = "" if self.form in ("linear", "proportional") else f"_{self.form}"
        return re.sub(r"[^a-z0-9]+", "_", f"{place}_follows_{covariate}{form}".lower())

    def _constant_range(self) -> tuple[float, float]:
        """Wider than the grid, which may hold a single value."""
        low, high = min(self.grid), max(self.grid)
        return (low - self.span, high + self.span) if self.form in ("step", "knee") else (low / 2, 2 * high)

    def refined_grid(
        self, value: float, count: int, criteria: DescriptionCriteria = DescriptionCriteria()
    ) -> Sequence[float]:
        """`count` values of the constant about one of the grid: between its neighbours; of a period, near it."""
        if self.form == "periodic":
            return refined_periods(value, self.unit, self.span, count, criteria)
        grid = sorted(self.grid)
        index = grid.index(value)
        low, high = grid[max(index - 1, 0)], grid[min(index + 1, len(grid) - 1)]
        if self.form == "lagged":
            return [float(f"{refined:.3g}") for refined in np.geomspace(low, high, count)]
        return [round_within(refined, ROUNDING * self.span) for refined in np.linspace(low, high, count).tolist()]


def empirical_terms(
    aligned: AlignedRecording, residual_um: FloatArray, criteria: DescriptionCriteria = DescriptionCriteria()
) -> Iterator[EmpiricalTerm]:
    """Every term that can be tried on a recording; without times none in time.

    residual_um : (N, m) what is to be described; periods are looked for in it. nan where a row does not count.
    """
    rows = aligned.usable.mask & np.isfinite(residual_um).all(axis=1)
    ports = list(_ports(aligned))
    timed = aligned.recording.has_time
    grid_of = _Grids(residual_um[rows], criteria, aligned.criteria.periods)
    mirrored = mirrored_predictions(aligned, criteria)
    reasons = untried_quantities(aligned, criteria, mirrored)
    for covariate in search_covariates(aligned, rows, criteria, mirrored, reasons):
        yield from _terms_of(covariate, ports, grid_of, timed=timed, known=aligned.model is not None)
    time = SearchCovariate("time_s", "other", aligned.rows.time_s[rows])
    for form in ("step", "linear", "periodic") if timed else ():
        grid = grid_of(form, time)
        for port in ports:
            if _repeats_along(port, form) and (grid or form not in CONSTANTS):
                yield _term(port, time, form, grid)
    if aligned.model is None:
        return
    for port in ports:
        if port.port == "link":
            for name, middle, form in _link_covariates(aligned, rows, reasons):
                yield replace(port, covariate=name, form=form, middle=middle)


def _terms_of(
    covariate: SearchCovariate, ports: Sequence[EmpiricalTerm], grid_of: _Grids, *, timed: bool, known: bool
) -> Iterator[EmpiricalTerm]:
    """Every form of one covariate at every port.

    timed : whether the rows have times, which a lag needs.  known : whether links have known lengths, which a strain
    needs.
    """
    grids: dict[str, tuple[float, ...]] = {"linear": ()}
    for form in FORMS_BY_KIND[covariate.kind]:
        if covariate.distinct >= MIN_VALUES.get(form, 2):
            grids[form] = grid_of(form, covariate)
    for form, grid in grids.items():
        for port in ports:
            if _repeats_along(port, form) and (grid or form not in CONSTANTS) and (timed or form != "lagged"):
                yield _term(port, covariate, form, grid)
            if form == "lagged" and port.port == "link" and known:  # expansion is proportional to length
                yield _term(port, covariate, "strain", ())


class _Grids(NamedTuple):
    """The values of a form's constant that are tried.

    residual_um : (R, m), in which periods are looked for.  spectrum : of that search.
    """

    residual_um: FloatArray
    criteria: DescriptionCriteria
    spectrum: PeriodCriteria

    def __call__(self, form: str, covariate: SearchCovariate) -> tuple[float, ...]:
        """Of a form of a covariate; empty for one without a constant."""
        if form == "step":
            return step_times_s(covariate.values, self.criteria)
        if form == "knee":
            return knees(covariate, self.criteria)
        if form == "periodic":
            return periods(covariate, self.residual_um, self.criteria, self.spectrum)
        return self.criteria.lags_s if form == "lagged" else ()


def _term(port: EmpiricalTerm, covariate: SearchCovariate, form: str, grid: tuple[float, ...]) -> EmpiricalTerm:
    return replace(port, covariate=covariate.name, form=form, middle=covariate.middle, span=covariate.span, grid=grid)


def _repeats_along(port: EmpiricalTerm, form: str) -> bool:
    """A tool that swings looks like an instrument that does, and links that swing apart like a machine that does."""
    return form != "periodic" or not (port.per_link or port.port == "tool")


def _ports(aligned: AlignedRecording) -> Iterator[EmpiricalTerm]:
    """Where terms may act, without covariate and form: of a known machine at links, tool and reference; of an external
    model at what was predicted, its links or the reference."""
    # a constant along each coordinate is part of every fit of an external model
    with_constant = aligned.registration_columns.shape[2] == 0
    if aligned.model is not None:
        yield EmpiricalTerm("", "", "link", 0.0, 0.0)
        yield EmpiricalTerm("", "", "link", 0.0, 0.0, per_link=True)
        if not aligned.of_links:
            yield EmpiricalTerm("", "", "tool", 0.0, 0.0, axes=("x", "y", "z"))
    elif aligned.of_links:
        # of a single link both are the same
        several = len(aligned.axes) > 1
        yield EmpiricalTerm("", "", "link", 0.0, 0.0, several, with_constant=with_constant, residual_unit=aligned.unit)
    if not aligned.of_links:
        axes = tuple("xyz"[axis] for axis in aligned.axes)
        unit = aligned.unit
        yield EmpiricalTerm("", "", "reference", 0.0, 0.0, axes=axes, with_constant=with_constant, residual_unit=unit)


def _link_covariates(
    aligned: AlignedRecording, rows: BoolArray, reasons: Mapping[str, str]
) -> Iterator[tuple[str, float, str]]:
    """Covariates that each link has of its own, with their middle and form.

    reasons : of the quantities that are not searched.
    """
    machine = aligned.rows
    links_by_quantity: dict[tuple[str, str], set[int]] = {}
    for name in aligned.recording.quantities:
        # one link's quantity may have stayed the same: the others' did not
        if (match := _LINK.match(name)) and reasons.get(name, STAYED_THE_SAME) == STAYED_THE_SAME:
            links_by_quantity.setdefault((match["what"], match["unit"]), set()).add(int(match["link"]))
    for (what, unit), links in links_by_quantity.items():
        if links >= set(range(1, machine.links + 1)):
            values = [machine.quantity(f"{what}_link_{i + 1}_{unit}")[rows] for i in range(machine.links)]
            name = "temperature_link" if (what, unit) == ("temperature", "degC") else f"{what}_link_{unit}"
            yield name, round_middle(np.array(values)), "linear"
    yield "direction", 0.0, "proportional"
    yield "velocity_mm_per_s", 0.0, "proportional"
    if {"force_x_N", "force_y_N", "force_z_N"} <= set(aligned.recording.quantities):
        yield "axial_force_N", round_middle(machine.axial_force_N[rows]), "linear"
