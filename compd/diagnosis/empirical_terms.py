"""Formula effects that describe what a residual follows: port x covariate x form. A description is not a cause."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.model.effect import Effect
from compd.model.library import find_effect
from compd.units import unit_of

HOUR_S = 3600.0
# Places where a step is looked for first, then between the best and its neighbours.
STEPS = 48
# Lags between a fan's minute and a granite plate's morning.
LAGS_S = (120.0, 300.0, 700.0, 1700.0, 4000.0, 10000.0)
# Where a slope may change: a cable comes taut, a stop is reached, a preload is used up.
KNEES = 8
# A period must span so many rows, and fit into the recording.
ROWS_PER_PERIOD = 6
MOST_PERIODS = 160
FEWEST_TURNS = 2
# A covariate that is empty in more rows than this is not looked at.
MOST_EMPTY = 0.1
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
# Of a number by its name; um where it is not here.
_UNITS = {"k": "um/{}", "m": "um/{}", "k2": "um/{}^2"}
_UNITS_OF_STRAIN = {"k": "ppm/{}", "c": "ppm"}


@dataclass(frozen=True)
class EmpiricalTerm:
    """One formula at one port, at one value of its shape constant.

    per_link : whether each link has a number of its own.  axes : of a port that holds a vector, one effect each.
    constant : name of the shape constant, "" for none; grid : its values.  middle : of the covariate.
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
        """The covariate's unit, as its name says it."""
        return unit_of(self.covariate) or "1"

    def effect(self) -> Effect:
        """To be searched; along the first axis where there are several."""
        return find_effect(self.declaration(self.axes[0]), "description")

    def declaration(
        self, axis: str, value: float | None = None, sizes: Mapping[str, float] | None = None
    ) -> dict[str, Any]:
        """A formula effect as a person would write it.

        value : of the shape constant, written into the formula; None leaves it a parameter.
        sizes : by linear parameter, how large it was found: the plausible range is three times that.
        """
        r = self.covariate
        about = f"({r} - {self.middle:g})" if self.middle > 0 else f"({r} + {-self.middle:g})" if self.middle else r
        formula = FORMS[self.form].format(q=about, r=r, m=f"{self.middle:g}")
        if value is not None and self.constant:
            formula = re.sub(rf"\b{self.constant}\b", f"{value:.6g}", formula)
        names = [name for name in ("k", "k2", "m", "a", "b", "c") if re.search(rf"\b{name}\b", formula)]
        source = "describes a residual; its cause is not known"
        parameters: dict[str, Any] = {}
        for name in names:
            size = 3 * abs((sizes or {}).get(name, 0.0)) or 1e3
            units = {} if self.form == "step" else _UNITS_OF_STRAIN if self.form == "strain" else _UNITS
            unit = units.get(name, "um").format(self.unit)
            parameters[name] = {
                "unit": unit,
                "plausible": [-float(f"{size:.3g}"), float(f"{size:.3g}")],
                "source": source,
            }
            if self.per_link:
                parameters[name]["per"] = "link"
        if self.constant and value is None:
            unit = self.unit if self.form == "knee" else "s"
            parameters[self.constant] = {"unit": unit, "plausible": [min(self.grid), max(self.grid)], "source": source}
        what = re.sub(r"[^a-z0-9]+", "_", f"{self.port}_follows_{r}".lower())
        return {
            "id": f"{what}_{self.form}" + (f"_{axis}" if axis else ""),
            "port": self.port,
            "formula": formula,
            **({"axis": axis} if axis else {}),
            "physics": "A description, not a cause: the residual follows this on the recordings that were looked at.",
            "parameters": parameters,
        }


def descriptions(aligned: AlignedRecording) -> Iterator[EmpiricalTerm]:
    """Everything that is tried on this recording."""
    usable, _ = aligned.usable
    time_s = aligned.rows.time_s[usable]
    ports = list(_ports(aligned))
    for name, values in _machine_wide(aligned):
        column = values[usable]
        if not _varies(column):
            continue
        middle = 0.0 if name.startswith("force_") else float(f"{np.nanmean(column):.3g}")
        for port in ports:
            for form in ("linear", "square"):
                yield replace(port, covariate=name, form=form, middle=middle)
            if name.startswith(("force_", "tip_")):
                if len(knees := _knees(column)) > 1:
                    yield replace(port, covariate=name, form="knee", middle=middle, constant="knee", grid=knees)
                continue
            if port.port == "link":  # what grows does so in proportion to its length
                yield replace(port, covariate=name, form="strain", middle=middle)
            yield replace(port, covariate=name, form="lagged", middle=middle, constant="tau", grid=LAGS_S)
    for port in ports:
        yield replace(port, covariate="time_s", form="linear", middle=float(f"{time_s.mean():.3g}"))
        yield replace(port, covariate="time_s", form="step", constant="start", grid=_starts(time_s))
        if not port.per_link and port.port != "tool":  # a tool that swings looks like an instrument that does
            yield replace(port, covariate="time_s", form="periodic", constant="period", grid=_periods(time_s))
    if aligned.model is None:
        return
    links = [port for port in ports if port.port == "link"]
    for name, middle, form in _of_links(aligned):
        for port in links:
            yield replace(port, covariate=name, form=form, middle=middle)


def _ports(aligned: AlignedRecording) -> Iterator[EmpiricalTerm]:
    """Where descriptions may act: what the reference shows, and of a known machine the links and the tool."""
    if aligned.model is not None:
        yield EmpiricalTerm("", "", "link", 0.0)
        yield EmpiricalTerm("", "", "link", 0.0, per_link=True)
    if not aligned.of_links:
        if aligned.model is not None:
            yield EmpiricalTerm("", "", "tool", 0.0, axes=("x", "y", "z"))
        yield EmpiricalTerm("", "", "reference", 0.0, axes=tuple("xyz"[axis] for axis in aligned.axes))


def _machine_wide(aligned: AlignedRecording) -> Iterator[tuple[str, FloatArray]]:
    """Measured quantities and the place of the tip."""
    yield from aligned.recording.quantities.items()
    if np.isfinite(aligned.rows.tip_M_mm).all(axis=1).any():
        for axis in range(3):
            yield f"tip_{'xyz'[axis]}_mm", aligned.rows.tip_M_mm[:, axis]


def _of_links(aligned: AlignedRecording) -> Iterator[tuple[str, float, str]]:
    """Covariates that each link has of its own, their middle and form."""
    rows = aligned.rows
    links: dict[tuple[str, str], set[int]] = {}
    for name in aligned.recording.quantities:
        if match := _LINK.match(name):
            links.setdefault((match["what"], match["unit"]), set()).add(int(match["link"]))
    for (what, unit), numbers in links.items():
        if numbers >= set(range(1, rows.links + 1)):
            values = [rows.quantity(f"{what}_link_{i + 1}_{unit}") for i in range(rows.links)]
            name = "temperature_link" if (what, unit) == ("temperature", "degC") else f"{what}_link_{unit}"
            yield name, float(f"{np.nanmean(values):.3g}"), "linear"
    yield "direction", 0.0, "proportional"
    yield "velocity_mm_per_s", 0.0, "proportional"
    if {"force_x_N", "force_y_N", "force_z_N"} <= set(aligned.recording.quantities):
        yield "axial_force_N", float(f"{np.nanmean(rows.axial_force_N):.3g}"), "linear"


def _varies(values: FloatArray) -> bool:
    known = values[np.isfinite(values)]
    return len(known) >= (1 - MOST_EMPTY) * len(values) > 0 and float(np.ptp(known)) > 1e-9 * max(1.0, float(known[0]))


def _knees(column: FloatArray) -> tuple[float, ...]:
    places = np.quantile(column[np.isfinite(column)], np.linspace(0, 1, KNEES + 2)[1:-1])
    return tuple(float(f"{one:.4g}") for one in np.unique(places))


def _starts(time_s: FloatArray) -> tuple[float, ...]:
    places = np.quantile(time_s, np.linspace(0, 1, STEPS + 2)[1:-1])
    return tuple(float(one) for one in np.unique(places))


def _periods(time_s: FloatArray) -> tuple[float, ...]:
    """Half a turn over the recording from one to the next: finer ones look the same."""
    span_s = float(np.ptp(time_s))
    shortest_s = ROWS_PER_PERIOD * max(float(np.median(np.diff(time_s))), span_s / 1e5)
    count = int(min(2 * span_s / shortest_s, MOST_PERIODS + 1))
    return tuple(2 * span_s / turns for turns in range(2 * FEWEST_TURNS, max(count, 2 * FEWEST_TURNS + 1)))


def finer(description: EmpiricalTerm, value: float, places: int) -> Sequence[float]:
    """Values of the shape constant between the best one's neighbours on the grid."""
    grid = sorted(description.grid)
    place = grid.index(value)
    low, high = grid[max(place - 1, 0)], grid[min(place + 1, len(grid) - 1)]
    if description.form in ("step", "knee"):
        return [float(one) for one in np.linspace(low, high, places)]
    return [float(one) for one in np.geomspace(low, high, places)]
