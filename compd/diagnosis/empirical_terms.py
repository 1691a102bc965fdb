"""Empirical terms: formula effects that describe what a residual follows, port x covariate x form; no causes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.diagnosis.candidates import MOST_EMPTY
from compd.model.effect import Effect
from compd.model.library import find_effect
from compd.units import UM_PER_MM, unit_of

# Times at which a step is looked for first; then between the best one's neighbours.
STEP_TIMES = 48
# Time constants of a lag, from a fan's minutes to a granite plate's morning.
LAGS_S = (120.0, 300.0, 700.0, 1700.0, 4000.0, 10000.0)
# Values of a covariate at which a slope may change: a cable comes taut, a stop is reached, a preload is used up.
KNEES = 8
# A period must span so many rows, and fit into the recording so many times.
ROWS_PER_PERIOD = 6
FEWEST_TURNS = 2
MOST_PERIODS = 160
_LINK = re.compile(r"^(?P<what>[a-z][a-z0-9_]*)_link_(?P<link>\d+)_(?P<unit>[A-Za-z]\w*)$")

# form -> formula; {q} covariate about its middle, {r} the covariate itself, {m} its middle; k.. per unit, c constant.
FORMS = {
    "linear": "k * {q} + c",
    "proportional": "k * {r}",
    "strain": "(k * {q} + c) * link_mm / 1000",
    "square": "k * {q} + k2 * {q}**2 + c",
    "knee": "k * {q} + m * maximum({r} - knee, 0) + c",
    "lagged": "k * (lag({r}, tau) - {m}) + c",
    "step": "k * (1 + sign(time_s - start)) / 2 + c",
    "periodic": "a * sin(2 * pi * time_s / period) + b * cos(2 * pi * time_s / period) + c",
}
# Unit of a parameter by its name, {} for the covariate's; um where it is not here.
_UNITS = {"k": "um/{}", "m": "um/{}", "k2": "um/{}^2"}
_UNITS_OF_STRAIN = {"k": "ppm/{}", "c": "ppm"}
# Plausible range of a parameter of which nothing is known, in its unit; of a fitted one, times its size.
UNKNOWN_RANGE = 1e3
RANGE_PER_SIZE = 3
SOURCE = "describes a residual; its cause is not known"


@dataclass(frozen=True)
class EmpiricalTerm:
    """One formula of one covariate at one port.

    form : a key of FORMS.  middle : of the covariate, about which the formula is written.
    per_link : whether each link has parameters of its own.
    axes : of a port that takes a vector, one effect each; ("",) for the links.
    constant : name of the nonlinear constant, "" for none.  grid : its values.
    """

    covariate: str
    form: str
    port: str
    middle: float
    per_link: bool = False
    axes: tuple[str, ...] = ("",)
    constant: str = ""
    grid: tuple[float, ...] = ()

    @property
    def unit(self) -> str:
        """Unit of the covariate, from the end of its name; "1" for none."""
        return unit_of(self.covariate) or "1"

    def effect(self) -> Effect:
        """The formula as an effect, its constant a parameter; along the first axis where there are several."""
        return find_effect(self.declaration(self.axes[0]), "description")

    def constant_values(self, value: float | None) -> dict[str, float]:
        """The nonlinear constants of `effect`, by name, at a value of the term's; None for a term without one."""
        return {} if value is None else {self.constant: value}

    def columns_um(self, aligned: AlignedRecording, effect: Effect, value: float | None) -> FloatArray:
        """(N, m, P) by how many um each parameter moves the prediction: all of the first axis, then of the next.

        effect : as from `effect`.  value : of the nonlinear constant; None for a term without one.
        """
        constants = self.constant_values(value)
        if self.axes == ("",):
            return aligned.columns(effect, constants) * UM_PER_MM
        basis, _ = effect.basis(aligned.rows, constants, None)
        factors = basis[:, "xyz".index(self.axes[0])] * UM_PER_MM
        along = self._measured_along_axes(aligned)
        return np.asarray((along[:, :, :, None] * factors[:, None, None, :]).reshape(*along.shape[:2], -1))

    def _measured_along_axes(self, aligned: AlignedRecording) -> FloatArray:
        """(N, m, axes) by how much the measured coordinates change per displacement of the port along each axis."""
        axes = ["xyz".index(axis) for axis in self.axes]
        if self.port == "reference":
            shown = np.equal.outer(aligned.axes, axes).astype(np.float64)
            return np.broadcast_to(shown, (len(aligned.rows), *shown.shape))
        return aligned.sensitivity(["tool"])["tool"].tip[:, list(aligned.axes)][:, :, axes]

    def declaration(
        self, axis: str, value: float | None = None, sizes: Mapping[str, float] | None = None
    ) -> dict[str, Any]:
        """The term as the declaration of a formula effect, as `compd effect add` reads it.

        value : of the nonlinear constant, to be written into the formula; None leaves it a parameter.
        sizes : largest fitted size by parameter; the plausible range is RANGE_PER_SIZE times that.
        """
        covariate = self.covariate
        about = covariate
        if self.middle:
            about = f"({covariate} {'-' if self.middle > 0 else '+'} {abs(self.middle):g})"
        formula = FORMS[self.form].format(q=about, r=covariate, m=f"{self.middle:g}")
        if value is not None and self.constant:
            formula = re.sub(rf"\b{self.constant}\b", f"{value:.6g}", formula)
        parameters: dict[str, Any] = {}
        for name in ("k", "k2", "m", "a", "b", "c"):
            if not re.search(rf"\b{name}\b", formula):
                continue
            size = RANGE_PER_SIZE * abs((sizes or {}).get(name, 0.0)) or UNKNOWN_RANGE
            units = {} if self.form == "step" else _UNITS_OF_STRAIN if self.form == "strain" else _UNITS
            parameters[name] = {
                "unit": units.get(name, "um").format(self.unit),
                "plausible": [-float(f"{size:.3g}"), float(f"{size:.3g}")],
                "source": SOURCE,
            }
            if self.per_link:
                parameters[name]["per"] = "link"
        if self.constant and value is None:
            unit = self.unit if self.form == "knee" else "s"
            parameters[self.constant] = {"unit": unit, "plausible": [min(self.grid), max(self.grid)], "source": SOURCE}
        subject = re.sub(r"[^a-z0-9]+", "_", f"{self.port}_follows_{covariate}".lower())
        return {
            "id": f"{subject}_{self.form}" + (f"_{axis}" if axis else ""),
            "port": self.port,
            "formula": formula,
            **({"axis": axis} if axis else {}),
            "physics": "A description, not a cause: the residual follows this on the recordings that were looked at.",
            "parameters": parameters,
        }

    def refined_grid(self, value: float, count: int) -> Sequence[float]:
        """`count` values of the constant between the neighbours of one of the grid."""
        grid = sorted(self.grid)
        place = grid.index(value)
        low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
        space = np.linspace if self.form in ("step", "knee") else np.geomspace
        return [float(refined) for refined in space(low, high, count)]


def empirical_terms(aligned: AlignedRecording) -> Iterator[EmpiricalTerm]:
    """Every term that can be tried on a recording."""
    usable = aligned.usable.mask
    time_s = aligned.rows.time_s[usable]
    ports = list(_ports(aligned))
    for name, values in _machine_covariates(aligned):
        column = values[usable]
        if not _varies(column, MOST_EMPTY):
            continue
        middle = 0.0 if name.startswith("force_") else float(f"{np.nanmean(column):.3g}")
        for port in ports:
            for form in ("linear", "square"):
                yield replace(port, covariate=name, form=form, middle=middle)
            if name.startswith(("force_", "tip_")):
                if len(knees := _knees(column)) > 1:
                    yield replace(port, covariate=name, form="knee", middle=middle, constant="knee", grid=knees)
                continue
            if port.port == "link":  # expansion is proportional to length
                yield replace(port, covariate=name, form="strain", middle=middle)
            yield replace(port, covariate=name, form="lagged", middle=middle, constant="tau", grid=LAGS_S)
    for port in ports:
        yield replace(port, covariate="time_s", form="linear", middle=float(f"{time_s.mean():.3g}"))
        yield replace(port, covariate="time_s", form="step", constant="start", grid=_step_times_s(time_s))
        if not port.per_link and port.port != "tool":  # a tool that swings looks like an instrument that does
            yield replace(port, covariate="time_s", form="periodic", constant="period", grid=_periods_s(time_s))
    if aligned.model is None:
        return
    link_ports = [port for port in ports if port.port == "link"]
    for name, middle, form in _link_covariates(aligned):
        for port in link_ports:
            yield replace(port, covariate=name, form=form, middle=middle)


def _ports(aligned: AlignedRecording) -> Iterator[EmpiricalTerm]:
    """Where terms may act, without covariate and form: at the reference, and of a known machine at links and tool."""
    if aligned.model is not None:
        yield EmpiricalTerm("", "", "link", 0.0)
        yield EmpiricalTerm("", "", "link", 0.0, per_link=True)
        if not aligned.of_links:
            yield EmpiricalTerm("", "", "tool", 0.0, axes=("x", "y", "z"))
    if aligned.model is None or not aligned.of_links:
        yield EmpiricalTerm("", "", "reference", 0.0, axes=tuple("xyz"[axis] for axis in aligned.axes[:3]))


def _machine_covariates(aligned: AlignedRecording) -> Iterator[tuple[str, FloatArray]]:
    """Measured quantities and the position of the tip."""
    yield from aligned.recording.quantities.items()
    if np.isfinite(aligned.rows.tip_M_mm).all(axis=1).any():
        for axis in range(3):
            yield f"tip_{'xyz'[axis]}_mm", aligned.rows.tip_M_mm[:, axis]


def _link_covariates(aligned: AlignedRecording) -> Iterator[tuple[str, float, str]]:
    """Covariates that each link has of its own, with their middle and form."""
    rows = aligned.rows
    links_by_quantity: dict[tuple[str, str], set[int]] = {}
    for name in aligned.recording.quantities:
        if match := _LINK.match(name):
            links_by_quantity.setdefault((match["what"], match["unit"]), set()).add(int(match["link"]))
    for (what, unit), links in links_by_quantity.items():
        if links >= set(range(1, rows.links + 1)):
            values = [rows.quantity(f"{what}_link_{i + 1}_{unit}") for i in range(rows.links)]
            name = "temperature_link" if (what, unit) == ("temperature", "degC") else f"{what}_link_{unit}"
            yield name, float(f"{np.nanmean(values):.3g}"), "linear"
    yield "direction", 0.0, "proportional"
    yield "velocity_mm_per_s", 0.0, "proportional"
    if {"force_x_N", "force_y_N", "force_z_N"} <= set(aligned.recording.quantities):
        yield "axial_force_N", float(f"{np.nanmean(rows.axial_force_N):.3g}"), "linear"


def _varies(values: FloatArray, most_empty: float) -> bool:
    """Whether a covariate is known in enough rows and not constant."""
    known = values[np.isfinite(values)]
    return len(known) >= (1 - most_empty) * len(values) > 0 and float(np.ptp(known)) > 1e-9 * max(1.0, float(known[0]))


def _knees(column: FloatArray) -> tuple[float, ...]:
    places = np.quantile(column[np.isfinite(column)], np.linspace(0, 1, KNEES + 2)[1:-1])
    return tuple(float(f"{place:.4g}") for place in np.unique(places))


def _step_times_s(time_s: FloatArray) -> tuple[float, ...]:
    times_s = np.quantile(time_s, np.linspace(0, 1, STEP_TIMES + 2)[1:-1])
    return tuple(float(step_time_s) for step_time_s in np.unique(times_s))


def _periods_s(time_s: FloatArray) -> tuple[float, ...]:
    """Periods that differ by half a turn over the recording: closer ones look the same there."""
    span_s = float(np.ptp(time_s))
    shortest_s = ROWS_PER_PERIOD * max(float(np.median(np.diff(time_s))), span_s / 1e5)
    count = int(min(2 * span_s / shortest_s, MOST_PERIODS + 1))
    return tuple(2 * span_s / turns for turns in range(2 * FEWEST_TURNS, max(count, 2 * FEWEST_TURNS + 1)))
