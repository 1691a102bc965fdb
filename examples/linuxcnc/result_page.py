"""Result of the demonstration in LinuxCNC: a table for the terminal, a sentence, and a page with a picture."""

from __future__ import annotations

from pathlib import Path

from plotly.graph_objects import Figure
from rich.table import Table as TerminalTable

from compd.arrays import rms
from compd.report import COLOURS, PageTable, Panel, style_figure, write_page
from demonstration import ADOPTED, OFF, ON, LinuxCncDemo

COLUMNS = ("tip error, um", "at rest, rms", "largest", "moving, rms", "largest")
RUN_COLOURS = {OFF: COLOURS["worst"], ON: COLOURS["middle"], ADOPTED: COLOURS["best"]}


def summarise(demo: LinuxCncDemo) -> TerminalTable:
    table = TerminalTable(title="distance of the true tip from where the program wants it")
    for number, name in enumerate(COLUMNS):
        table.add_column(name, justify="right" if number else "left", no_wrap=True)
    for row in _rows(demo):
        table.add_row(*row)
    return table


def verdict(demo: LinuxCncDemo) -> str:
    """The result in one sentence, for the rests or, without rests, for the whole program."""
    errors = demo.errors.values()
    resting = all(len(run.at_rest_um) for run in errors)
    parts = [
        f"{rms(run.at_rest_um if resting else run.error_um):.2f} um with {label}" for label, run in demo.errors.items()
    ]
    adopted = f"; adopted: {', '.join(demo.adopted)}" if demo.adopted else "; no effect was found"
    return f"{'At rest' if resting else 'Along the program'} the tip's error (rms) is {', '.join(parts)}{adopted}."


def write_result_page(path: Path, demo: LinuxCncDemo) -> None:
    panels = [
        Panel(
            "The same program, each time as LinuxCNC ran it",
            "Distance between the true tip and where the program wants it; the scale is logarithmic. On the move a "
            "correction is as late as the gauges that it comes from.",
            _errors(demo),
        ),
        Panel("In numbers", "rms and largest, um.", PageTable(COLUMNS, _rows(demo))),
        Panel(
            "What was probed, and what it says",
            demo.diagnosis,
            PageTable(("", ""), [("rows probed", str(demo.rows)), ("adopted", ", ".join(demo.adopted) or "no effect")]),
        ),
    ]
    footer = "LinuxCNC on a simulated machine, gauges on real ptys; the truth shares no code with the model."
    write_page(path, "LinuxCNC, corrected by compd", verdict(demo), panels, footer)


def _rows(demo: LinuxCncDemo) -> list[tuple[str, ...]]:
    return [(label, *errors.summary()) for label, errors in demo.errors.items()]


def _errors(demo: LinuxCncDemo) -> Figure:
    figure = Figure()
    for label, errors in demo.errors.items():
        figure.add_scatter(
            x=errors.time_s, y=errors.error_um, name=label, mode="lines", line={"color": RUN_COLOURS[label]}
        )
    figure.update_yaxes(type="log", dtick=1)
    return style_figure(figure, "time since the program began, s", "tip error, um")
