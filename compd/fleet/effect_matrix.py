"""The overview figure of a fleet: a line for each machine, a column with the value of each effect."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from plotly.graph_objects import Figure, Heatmap

from compd.fleet.drift import Drift
from compd.fleet.overview import NOT_EXPLAINED, Overview
from compd.report import COLOURS, PageTable, style_figure

NO_EFFECTS = PageTable(("",), [("no effect was found, and the models have none",)])
ROW_PX = 26
# Numbers of a cell's special colours, beyond the share of recordings (0 to 1).
_DRIFTS, _DIFFERS, _UNEXPLAINED, _MOST = 2.0, 3.0, 4.0, 4.0
# The column of effects that no machine has on most of its recordings.
SELDOM = "seldom found"
# Colour of a share below that of an effect: paler than any of an effect.
_PALE = 0.4


class _Cell(NamedTuple):
    """Content of a cell: number of its colour, text, and text at the pointer."""

    colour: float
    text: str
    hover: str


def plot_effect_matrix(overview: Overview) -> Figure | PageTable:
    """Machines with an effect, or with an error that none explains, and what each effect amounts to.

    Machines with the same effects stand together, those of one kinematics too. NO_EFFECTS where there is no such
    machine.
    """
    columns = _columns(overview)
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
            x=[_head(column, overview) for column in columns],
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
    style_figure(figure, "", "", 140 + ROW_PX * len(machines))
    return figure.update_yaxes(autorange="reversed", automargin=True, type="category", dtick=1).update_xaxes(
        side="top", automargin=True, type="category", dtick=1
    )


def _place(overview: Overview, machine: str) -> tuple[str, tuple[bool, ...], str]:
    """Sort key of machines: kinematics, then effects, the most common first, then the name."""
    has = overview.steady[machine]
    return (
        overview.of(machine)[0].kinematics,
        tuple(effect not in has for effect in overview.effects),
        machine,
    )


def _columns(overview: Overview) -> list[str]:
    seldom = any(
        set(result.effects) - set(overview.steady[result.machine]) - set(overview.effects)
        for result in overview.examined
    )
    return [*overview.effects, *([SELDOM] if seldom else []), *([NOT_EXPLAINED] if overview.unexplained else [])]


def _head(column: str, overview: Overview) -> str:
    """The column's name with the unit of its numbers, where they have one."""
    units = {drift.unit for drift in overview.drifts if drift.effect == column} - {"1"}
    return f"{column}<br>{units.pop()}" if len(units) == 1 else column


def _cell(overview: Overview, machine: str, column: str, series: Sequence[Drift]) -> _Cell:
    results, counts = overview.of(machine), overview.counts(machine)
    if column == NOT_EXPLAINED:
        count = overview.unexplained[machine]
        text = f"{count} of {len(results)}" if count else ""
        return _Cell(_UNEXPLAINED if machine in overview.unexplained_machines else 0.0, text, text)
    if column == SELDOM:
        effects = [effect for effect in counts if effect not in overview.effects]
        hover = "<br>".join(f"{effect}: {counts[effect]} of {len(results)}" for effect in effects)
        most = max((counts[effect] for effect in effects), default=0)
        return _Cell(_PALE * most / len(results), f"{most} of {len(results)}" if most else "", hover)
    count = counts[column]
    rivalled = any(estimate.rivals for result in results for estimate in result.estimates if estimate.effect == column)
    share = f"{count} of {len(results)}{' ?' if rivalled else ''}" if count else ""
    if column not in overview.steady[machine]:
        return _Cell(_PALE * count / len(results), share, share)
    values = _values_text(series)
    text = values + (" ?" if rivalled else "") if count == len(results) else f"{values}, {share}"
    hover = "<br>".join([share, *(f"{drift.parameter}: {_middle(drift):.3g} {drift.unit}" for drift in series)])
    names = {drift.name for drift in series}
    colour = count / len(results)
    if any(outlying.machine == machine and outlying.quantity in names for outlying in overview.outlying):
        colour = _DIFFERS
    if any(drift.named for drift in series):
        colour = _DRIFTS
    return _Cell(colour, text, hover)


def _values_text(series: Sequence[Drift]) -> str:
    """ "1.5" for the median; "0.5 to 2.3" for the ends of a drift's line; "0.7 ... 1.5" for several parameters."""
    named = [drift for drift in series if drift.named]
    if named:
        first, last = (named[0].intercept + named[0].slope * float(named[0].time[k]) for k in (0, -1))
        return f"{first:.2g} to {last:.2g}"
    middles = [_middle(drift) for drift in series]
    if len(middles) == 1:
        return f"{middles[0]:.3g}"
    return f"{min(middles):.2g} ... {max(middles):.2g}"


def _middle(drift: Drift) -> float:
    """The median of its values."""
    return float(np.median(drift.value))


def _scale() -> list[tuple[float, str]]:
    """Colours by a cell's number: shares from white to blue, then a colour for each that stands for itself."""
    steps = ((_DRIFTS, "middle"), (_DIFFERS, "worst"), (_UNEXPLAINED, "quiet"))
    scale = [(0.0, "#ffffff"), (1.0 / _MOST, COLOURS["plain"])]
    for number, name in steps:
        scale += [((number - 0.5) / _MOST, COLOURS[name]), (min(number + 0.4, _MOST) / _MOST, COLOURS[name])]
    return scale
