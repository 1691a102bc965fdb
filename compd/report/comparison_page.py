"""The page of one or more comparisons: the same panels every time, in the same order, offline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from plotly.graph_objects import Figure

from compd.comparison import Comparison, covariates
from compd.model_file import parameter_estimates
from compd.report.comparison_table import name_of, no_trend_text, summary
from compd.report.figures import (
    plot_contributions,
    plot_histogram,
    plot_link_residuals,
    plot_residual_vectors,
    plot_workspace_map,
)
from compd.report.page import Panel, write_page
from compd.report.page_table import PageTable
from compd.report.small_multiples import plot_residual_against

HOW_TO_READ = "Dots are rows (at most 500 are drawn), lines are means over all rows; a flat line at zero is right."


def write_comparison_page(path: Path, comparisons: Sequence[Comparison], shared_script: bool = False) -> None:
    """Write the page for one recording or more; shared_script as in `write_page`."""
    machine = comparisons[0].aligned.recording.machine
    effects = ", ".join(effect.effect.id for effect in comparisons[0].fitted) or "none"
    verdict = " ".join(
        f"{name_of(comparison)}: {_verdict(comparison)}" if len(comparisons) > 1 else _verdict(comparison)
        for comparison in comparisons
    )
    bases = dict.fromkeys(comparison.basis for comparison in comparisons if comparison.basis)
    caption = " ".join(["A rms is per coordinate: root of the mean over rows and axes.", *bases])
    panels = [Panel("In numbers", caption, summary(comparisons))]
    if comparisons[0].fitted:
        numbers = _effects(comparisons[0])
        panels.append(Panel("The model's effects", "Fitted numbers with their standard errors.", numbers))
    for comparison in comparisons:
        panels += _panels(comparison, f"{name_of(comparison)}: " if len(comparisons) > 1 else "")
    hashes = "; ".join(
        f"{name_of(comparison)} sha256 {comparison.aligned.recording.sha256}" for comparison in comparisons
    )
    footer = f"Effects in the model: {effects}. {hashes}"
    write_page(path, f"Model and measurement: {machine}", verdict, panels, footer, shared_script)


def _panels(comparison: Comparison, prefix: str) -> list[Panel]:
    """The panels of one recording: the same for every recording and model."""
    by_name = {covariate.name: covariate for covariate in covariates(comparison.aligned)}

    def beginning_with(*begins: str) -> list[str]:
        return [name for name in by_name if name.startswith(begins)]

    groups: dict[str, list[str]] = {
        "time": ["time"] if "time" in by_name else [],
        "temperature": beginning_with("temperature"),
        "force": beginning_with("force"),
        "direction": beginning_with("direction"),
        "link length": beginning_with("length of"),
        "x, y, z": [name for name in ("x", "y", "z") if name in by_name],
    }
    placed = {name for names in groups.values() for name in names}
    groups["everything else measured"] = [name for name in by_name if name not in placed]
    vectors, enlarged = plot_residual_vectors(comparison)
    of_sample = " Of the sample." if comparison.basis else ""
    how_to_read = HOW_TO_READ + of_sample
    sentences = [trend.text for trend in comparison.trends] or [no_trend_text(comparison)]
    panels = [
        Panel(
            "Where it fails",
            "One coordinate at a time, straight lines only: a first look.",
            PageTable(("",), [[text] for text in sentences]),
        ),
        Panel(
            "What each part does", "The error that is left with one part switched off.", plot_contributions(comparison)
        ),
        Panel(
            "Residual vectors",
            "Measured minus modelled at the tip"
            + (f", enlarged {enlarged:g} times." if isinstance(vectors, Figure) else ".")
            + of_sample,
            vectors,
        ),
        *(
            Panel(
                f"Residual against {group}",
                how_to_read,
                plot_residual_against(comparison, [by_name[name] for name in names]),
            )
            for group, names in groups.items()
        ),
        Panel(
            "Residual pulled back to the links",
            "The errors of link lengths that would explain the residual at "
            f"the tip: where one link stands out, look there.{of_sample}",
            plot_link_residuals(comparison),
        ),
        Panel(
            "Histogram against the noise floor",
            " ".join(_sentence(text) for text in (comparison.floor.how, comparison.floor.contradiction) if text)
            + of_sample,
            plot_histogram(comparison),
        ),
        Panel(
            "Map over the workspace",
            f"Rms residual in cells of the workspace; white where nothing was measured.{of_sample}",
            plot_workspace_map(comparison),
        ),
        Panel(
            "Rows that do not count",
            "Kept in the file; what is not used counts for no number here.",
            _excluded(comparison),
        ),
    ]
    return [Panel(prefix + panel.title, panel.caption, panel.content) for panel in panels]


def _verdict(comparison: Comparison) -> str:
    """The result with the noise floor's remark that the recording may be wrong."""
    remark = comparison.floor.contradiction
    return f"{comparison.verdict} {_sentence(remark)}" if remark else comparison.verdict


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _excluded(comparison: Comparison) -> PageTable:
    rows = [[reason, str(count)] for reason, count in comparison.left_out.items()]
    rows += [[fault.text, str(len(fault.rows) or comparison.rows)] for fault in comparison.faults]
    return PageTable(("reason", "rows"), rows or [["none", "0"]])


def _effects(comparison: Comparison) -> PageTable:
    rows = [
        [effect, number["name"], f"{number['value']:.5g}", f"{number['std']:.2g}", number["unit"]]
        for effect, number in parameter_estimates(comparison.fitted, comparison.aligned.rows.links)
    ]
    return PageTable(("effect", "parameter", "value", "standard error", "unit"), rows)
