"""The figure that shows a fleet at a glance: a line for each machine, a column for each effect, in it its value."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from plotly.graph_objects import Figure, Heatmap

from compd.fleet.drift import Drift
from compd.fleet.overview import NOT_EXPLAINED, Overview
from compd.number_text import number_text
from compd.report.page import COLOURS, style_figure
from compd.report.page_table import PageTable

NO_EFFECTS = PageTable(("",), [("no effect was found, and the models have none",)])
ROW_PX = 26
# What colours a cell beyond the share of recordings, 0 to 1: a number of its own for each.
_DRIFTS, _DIFFERS, _UNEXPLAINED, _MOST = 2.0, 3.0, 4.0, 4.0
# What a value is, of a parameter of which there is one for each link or axis.
_SEVERAL = "{count} parameters"


class _Cell(NamedTuple):
    """What a cell shows: its colour's number, its text, and what the pointer shows."""

    colour: float
    text: str
    hover: str


def plot_effect_matrix(overview: Overview) -> Figure | PageTable:
    """Machines with an effect, or with an error that none explains, and what each effect amounts to.

    Machines with the same effects stand together, those of one kinematics too. NO_EFFECTS where there is no such
    machine.
    """
    columns = [*overview.effects, *([NOT_EXPLAINED] if overview.unexplained else [])]
    machines = [machine for machine in overview.machines if machine not in overview.quiet]
    if not columns or not machines:
        return NO_EFFECTS
    machines.sort(key=lambda machine: _place(overview, machine))
    series: dict[tuple[str, str], list[Drift]] = {}
    for drift in overview.drifts:
        series.setdefault((drift.machine, drift.effect), []).append(drift)
    cells = [
        [_cell(overview, machine, column, series.get((machine, column), [])) for column in columns]
        for machine in machines
    ]
    figure = Figure(
        Heatmap(
            x=columns,
            y=machines,
            z=[[cell.colour / _MOST for cell in row] for row in cells],
            text=[[cell.text for cell in row] for row in cells],
            customdata=[[cell.hover for cell in row] for row in cells],
            texttemplate="%{text}",
            textfont={"size": 12},
            hovertemplate="%{y}, %{x}: %{customdata}<extra></extra>",
            colorscale=_scale(),
            zmin=0,
            zmax=1,
            xgap=2,
            ygap=2,
            showscale=False,
        )
    )
    style_figure(figure, "", "", 120 + ROW_PX * len(machines))
    return figure.update_yaxes(autorange="reversed", automargin=True, type="category", dtick=1).update_xaxes(
        side="top", automargin=True, type="category", dtick=1
    )


def _place(overview: Overview, machine: str) -> tuple[str, tuple[bool, ...], str]:
    """By which machines are sorted: kinematics, then effects, the most common first, then the name."""
    has = overview.steady[machine]
    return (
        overview.of(machine)[0].kinematics,
        tuple(effect not in has for effect in overview.effects),
        machine,
    )


def _cell(overview: Overview, machine: str, column: str, series: Sequence[Drift]) -> _Cell:
    results = overview.of(machine)
    if column == NOT_EXPLAINED:
        count = overview.unexplained.get(machine, 0)
        text = f"{count} of {len(results)}" if count else ""
        return _Cell(_UNEXPLAINED if 2 * count > len(results) else 0.0, text, text)
    count = overview.counts(machine)[column]
    if not count:
        return _Cell(0.0, "", "not found")
    rivalled = any(estimate.rivals for result in results for estimate in result.estimates if estimate.effect == column)
    share = f"{count} of {len(results)}{' ?' if rivalled else ''}"
    values = [_value_text(drift) for drift in series]
    value = values[0] if len(values) == 1 else _SEVERAL.format(count=len(values))
    text = value if count == len(results) and not rivalled else f"{value}, {share}"
    hover = "<br>".join([share, *(f"{drift.parameter}: {text}" for drift, text in zip(series, values, strict=True))])
    if column not in overview.steady[machine]:
        return _Cell(0.5 * count / len(results), share, hover)
    colour = count / len(results)
    if any(
        outlying.machine == machine and outlying.quantity in {drift.name for drift in series}
        for outlying in overview.outlying
    ):
        colour = _DIFFERS
    if any(drift.named for drift in series):
        colour = _DRIFTS
    return _Cell(colour, text, hover)


def _value_text(drift: Drift) -> str:
    """ "1.50 ppm/K" by the median; of one that drifts its line's ends, "0.50 to 2.31 ppm/K"."""
    if drift.named:
        first, last = (drift.intercept + drift.slope * float(drift.time[k]) for k in (0, -1))
        return f"{number_text(first, '', digits=3).strip()} to {number_text(last, drift.unit, digits=3)}"
    ordered = sorted(drift.value.tolist())
    return number_text(ordered[len(ordered) // 2], drift.unit, digits=3)


def _scale() -> list[tuple[float, str]]:
    """Colours by a cell's number: shares from white to blue, then a colour for each that stands for itself."""
    steps = ((_DRIFTS, "middle"), (_DIFFERS, "worst"), (_UNEXPLAINED, "quiet"))
    scale = [(0.0, "#ffffff"), (1.0 / _MOST, COLOURS["plain"])]
    for number, name in steps:
        scale += [((number - 0.5) / _MOST, COLOURS[name]), (min(number + 0.4, _MOST) / _MOST, COLOURS[name])]
    return scale
