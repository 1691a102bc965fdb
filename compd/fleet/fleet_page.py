"""The page of a fleet: effects by machine, drifts, differing machines, unreadable recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from compd.fleet.criteria import FleetCriteria
from compd.fleet.effect_matrix import plot_effect_matrix
from compd.fleet.fleet_figures import plot_drifts, plot_errors
from compd.fleet.overview import Overview
from compd.fleet.recording_result import RecordingResult
from compd.report import PageTable, Panel, write_page


def write_fleet_page(path: Path, results: Sequence[RecordingResult], criteria: FleetCriteria = FleetCriteria()) -> None:
    """Write the page; it works offline. results : at least one.  criteria : by which drifts and machines are named."""
    overview = Overview(results, criteria=criteria)
    verdict = overview.headline
    panels = [
        Panel(
            "What to look at",
            "What drifts, which machine differs, and errors without a known cause; the evidence is below.",
            _list(overview.sentences()),
        ),
        Panel("Which machine has which effect", _matrix_caption(overview), plot_effect_matrix(overview)),
        Panel(
            "How parameters change from campaign to campaign",
            f"Bars are standard errors. A line is drawn where chance makes so steep a one less than once in "
            f"{1 / criteria.drift_p_value:g} such pages; it takes {criteria.fewest_campaigns} campaigns.",
            plot_drifts(overview),
        ),
        Panel(
            "The error of each machine",
            f"Dots are recordings. A machine differs where its median, or one of its parameters, is more than "
            f"{criteria.outlying_score:g} robust standard deviations from the median of all machines that are built "
            f"alike, errors of those with the same effects; it takes {criteria.fewest_machines} machines.",
            plot_errors(overview),
        ),
        Panel(
            "Every machine",
            "Medians over the machine's recordings: the error, what is left of it with its effects, and noise alone.",
            overview.machine_table(),
        ),
    ]
    if overview.failed:
        problems = Panel(
            "Recordings that could not be examined", "They count in nothing here.", overview.problem_table()
        )
        panels.insert(1, problems)
    commands = ", ".join(sorted({f"compd fleet {result.command}" for result in results}))
    models = sorted({result.model for result in results if result.model})
    footer = f"By {commands}; models: {', '.join(models) or 'none'}."
    count = len(overview.machines)
    write_page(path, f"A fleet of {count} {'machine' if count == 1 else 'machines'}", verdict, panels, footer)


def _matrix_caption(overview: Overview) -> str:
    """Explanation of the colours, and the omitted machines."""
    text = (
        "Blue: found on most recordings; the number is the median over these, from the smallest to the largest where "
        "the effect has a number for each link or axis. Orange: it drifts, from the first to the last value of its "
        "line. Red: it differs from the other machines'. Grey: an error of which no effect is the whole cause. A "
        "question mark: on a recording another effect would do as well."
    )
    if not overview.quiet:
        return text
    return f"{text} {len(overview.quiet)} without any of these: {', '.join(overview.quiet)}."


def _list(sentences: Sequence[str]) -> PageTable:
    return PageTable(("",), [[sentence] for sentence in sentences or ["nothing drifts, and no machine differs"]])
