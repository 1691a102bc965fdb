"""The page of one or more comparisons: the same panels every time, in the same order, offline."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from plotly.graph_objects import Figure

from compd.comparison.compare import Comparison
from compd.comparison.covariates import covariates
from compd.model_file import ModelFile, numbers_of
from compd.report.figures import (
    plot_contributions,
    plot_histogram,
    plot_link_residuals,
    plot_residual_vectors,
    plot_workspace_map,
)
from compd.report.page import PageTable, Panel, write_page
from compd.report.small_multiples import plot_residual_against

HOW_TO_READ = "Dots are rows (at most 500 are drawn), lines are means over all rows; a flat line at zero is right."


def summary(comparisons: Sequence[Comparison]) -> PageTable:
    """Numbers of every recording side by side."""
    head = ["", *(name_of(one) for one in comparisons)]
    rows: list[list[str]] = [
        ["residual, rms per coordinate", *(f"{one.rms_um:.3g} um" for one in comparisons)],
        ["noise floor", *(f"{one.floor.um:.3g} um ({one.floor.source})" for one in comparisons)],
        ["floor ratio, 1 = at the floor", *(f"{one.floor_ratio:.3g}" for one in comparisons)],
    ]
    labels = list(dict.fromkeys(label for one in comparisons for label in one.aligned.labels))
    rows += [[f"{label}: rms / 95 % / largest", *(_axis(one, label) for one in comparisons)] for label in labels]
    rows.append(["distance in 3D: rms / 95 % / largest", *(_distance(one) for one in comparisons)])
    sources = list(dict.fromkeys(name for one in comparisons for name in one.contributions))
    rows += [[f"rms without {name}", *(_without(one, name) for one in comparisons)] for name in sources]
    rows += [
        ["prediction's own uncertainty", *(_uncertainty(one) for one in comparisons)],
        ["rows used", *(str(int(one.used.sum())) for one in comparisons)],
        ["rows beyond all noise", *(str(int(one.outlier.sum())) for one in comparisons)],
        ["rows left out", *(str(sum(one.left_out.values())) for one in comparisons)],
    ]
    return PageTable(head, rows)


def name_of(comparison: Comparison) -> str:
    """The recording's file, with its folder: `train.csv` alone says nothing."""
    path = comparison.aligned.recording.path.resolve()
    return f"{path.parent.name}/{path.name}"


def nothing_found(one: Comparison) -> str:
    """What to say where the residual follows nothing in a straight line."""
    if one.at_floor:
        return "nowhere: what is left is noise"
    return "no straight line in anything measured explains what is left; look at the pictures for bends and steps"


def write_comparison_page(path: Path, comparisons: Sequence[Comparison], model: ModelFile | None) -> None:
    """Write the page for one recording or more."""
    machine = comparisons[0].aligned.recording.machine
    effects = ", ".join(one.effect.id for one in comparisons[0].fitted) or "none"
    verdict = " ".join(f"{name_of(one)}: {one.verdict}" if len(comparisons) > 1 else one.verdict for one in comparisons)
    panels = [
        Panel("In numbers", "A rms is per coordinate: root of the mean over rows and axes.", summary(comparisons))
    ]
    if model is not None and model.fitted:
        numbers = _effects(model, comparisons[0])
        panels.append(Panel("The model's effects", "Fitted numbers with their standard errors.", numbers))
    for one in comparisons:
        panels += _panels(one, f"{name_of(one)}: " if len(comparisons) > 1 else "")
    hashes = "; ".join(f"{name_of(one)} sha256 {one.aligned.recording.sha256}" for one in comparisons)
    write_page(path, f"Model and measurement: {machine}", verdict, panels, f"Effects in the model: {effects}. {hashes}")


def _panels(one: Comparison, prefix: str) -> list[Panel]:
    """The panels of one recording: the same for every recording and model."""
    found = {covariate.name: covariate for covariate in covariates(one.aligned)}

    def named(*begins: str) -> list[str]:
        return [name for name in found if name.startswith(begins)]

    groups: dict[str, list[str]] = {
        "time": ["time"] if "time" in found else [],
        "temperature": named("temperature"),
        "force": named("force"),
        "direction": named("direction"),
        "link length": named("length of"),
        "x, y, z": [name for name in ("x", "y", "z") if name in found],
    }
    placed = {name for names in groups.values() for name in names}
    groups["everything else measured"] = [name for name in found if name not in placed]
    vectors, enlarged = plot_residual_vectors(one)
    said = [finding.text for finding in one.trends] or [nothing_found(one)]
    sentences = PageTable(("",), [[text] for text in said])
    panels = [
        Panel("Where it fails", "One coordinate at a time, straight lines only: a first look.", sentences),
        Panel("What each part does", "The error that is left with one part switched off.", plot_contributions(one)),
        Panel(
            "Residual vectors",
            "Measured minus modelled at the tip"
            + (f", enlarged {enlarged:g} times." if isinstance(vectors, Figure) else "."),
            vectors,
        ),
        *(
            Panel(f"Residual against {group}", HOW_TO_READ, plot_residual_against(one, [found[name] for name in names]))
            for group, names in groups.items()
        ),
        Panel(
            "Residual pulled back to the links",
            "The errors of link lengths that would explain the residual at "
            "the tip: where one link stands out, look there.",
            plot_link_residuals(one),
        ),
        Panel(
            "Histogram against the noise floor", f"{one.floor.how[0].upper()}{one.floor.how[1:]}.", plot_histogram(one)
        ),
        Panel(
            "Map over the workspace",
            "Rms residual in cells of the workspace; white where nothing was measured.",
            plot_workspace_map(one),
        ),
        Panel("Rows that do not count", "Kept in the file, not used for any number here.", _excluded(one)),
    ]
    return [Panel(prefix + panel.title, panel.caption, panel.content) for panel in panels]


def _excluded(one: Comparison) -> PageTable:
    rows = [[why, str(count)] for why, count in one.left_out.items()]
    numbers = one.aligned.recording.row[one.outlier].tolist()
    if numbers:
        shown = ", ".join(map(str, numbers[:40])) + (f" and {len(numbers) - 40} more" if len(numbers) > 40 else "")
        rows.append([f"beyond all noise: rows {shown}", str(len(numbers))])
    return PageTable(("reason", "rows"), rows or [["none", "0"]])


def _effects(model: ModelFile, one: Comparison) -> PageTable:
    rows = [
        [effect, number["name"], f"{number['value']:.5g}", f"{number['std']:.2g}", number["unit"]]
        for effect, number in numbers_of(model.fitted, one.aligned.rows.links)
    ]
    return PageTable(("effect", "parameter", "value", "standard error", "unit"), rows)


def _axis(one: Comparison, label: str) -> str:
    if label not in one.aligned.labels:
        return "-"
    size = np.abs(one.residual_um[one.used, one.aligned.labels.index(label)])
    rms = float(np.sqrt(np.mean(size**2)))
    return f"{rms:.3g} / {np.quantile(size, 0.95):.3g} / {size.max():.3g} um"


def _distance(one: Comparison) -> str:
    if one.aligned.of_links or len(one.aligned.labels) < 3:
        return "-"
    distance = one.distance_um[one.used]
    return f"{np.sqrt(np.mean(distance**2)):.3g} / {np.quantile(distance, 0.95):.3g} / {distance.max():.3g} um"


def _without(one: Comparison, name: str) -> str:
    return f"{one.contributions[name].without_rms_um:.3g} um" if name in one.contributions else "-"


def _uncertainty(one: Comparison) -> str:
    total = float(np.sqrt(np.mean(one.uncertainty.total_um[one.used] ** 2)))
    return "not known" if np.isnan(total) else f"{total:.2g} um"
