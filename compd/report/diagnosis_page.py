"""A diagnosis as a page: the verdict, the evidence for each effect, every candidate, what to measure next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import yaml
from plotly.graph_objects import Figure

from compd.comparison.compare import Comparison
from compd.comparison.covariates import Covariate, covariates
from compd.diagnosis.findings import CandidateResult, DiagnosisStep, EmpiricalFinding
from compd.diagnosis.holdout import Holdout
from compd.diagnosis.summary import in_um
from compd.diagnosis.verdict import Diagnosis
from compd.model.effect import Effect
from compd.model.effect_needs import needed_quantities
from compd.report.page import COLOURS, PageTable, Panel, style_figure, write_page
from compd.report.small_multiples import small_multiples
from compd.units import unit_of


def write_diagnosis_page(
    path: Path, diagnosis: Diagnosis, holdouts: Sequence[Holdout], shared_script: bool = False
) -> None:
    """Write the page; it works offline. shared_script : as in `write_page`."""
    recording = diagnosis.before.aligned.recording
    panels = [_falling_error(diagnosis, holdouts)]
    for number, step in enumerate(diagnosis.steps, start=1):
        panels += _step_panels(number, step, diagnosis)
    if diagnosis.depends_on:
        panels += [*_rest_against(diagnosis), _dependences(diagnosis), _formula(diagnosis)]
    panels.append(_candidates(diagnosis.candidates))
    if diagnosis.next_measurement:
        panels.append(_next_rows(diagnosis))
    footer = (
        f"{recording.path}, sha256 {recording.sha256[:16]}; {int(diagnosis.after.used.sum())} rows used; "
        f"noise floor: {diagnosis.before.floor.how}."
    )
    title = f"Diagnosis of {recording.machine}: {diagnosis.verdict}"
    write_page(path, title, diagnosis.summary, panels, footer, shared_script)


def _falling_error(diagnosis: Diagnosis, holdouts: Sequence[Holdout]) -> Panel:
    """Bars: the error as it was, with each effect, and on held-out recordings; the floor as a line."""
    # each bar has the effects of those before it too
    words = ["with", *["and"] * len(diagnosis.steps)]
    steps = zip(words, diagnosis.steps, strict=False)
    names = ["as it was", *(f"{word} {step.effect.id}" for word, step in steps)]
    values = [diagnosis.before.rms_um, *(step.heldout_rms_um for step in diagnosis.steps)]
    colours = [COLOURS["worst"], *[COLOURS["middle"]] * (len(diagnosis.steps) - 1), COLOURS["best"]][: len(names)]
    for first in diagnosis.depends_on[:1]:
        names.append(f"described by {_covariate_text(first)}")
        values.append(first.heldout_rms_um)
        colours.append(COLOURS["quiet"])
    for holdout in holdouts:
        name = holdout.after.aligned.recording.path.name
        names.append(f"{name}, before")
        values.append(holdout.before.rms_um)
        colours.append(COLOURS["quiet"])
        if diagnosis.steps:
            names.append(f"{name}, after")
            values.append(holdout.after.rms_um)
            colours.append(COLOURS["plain"])
    figure = Figure()
    figure.add_bar(x=names, y=values, marker_color=colours, name="error")
    floor_um = diagnosis.before.floor.um
    figure.add_hline(y=floor_um, line_dash="dot")
    # on a ground of their own: where nothing is missing, the line of the noise would cross the number
    label = {"yanchor": "bottom", "yshift": 2, "showarrow": False, "bgcolor": "white", "borderpad": 1}
    for name, value in zip(names, values, strict=True):
        figure.add_annotation(text=in_um(value), x=name, y=value, **label)
    beside = {"xref": "paper", "x": 1, "xanchor": "left", "showarrow": False}
    figure.add_annotation(text=" noise alone", y=floor_um, **beside)
    caption = (
        "Error per coordinate, rms. With an effect or a description: on rows that were left out when its numbers were "
        "fitted."
    )
    style_figure(figure, "", "error, um", 300).update_layout(showlegend=False, margin={"r": 100})
    return Panel("The falling error", caption, figure)


def _step_panels(number: int, step: DiagnosisStep, diagnosis: Diagnosis) -> list[Panel]:
    effect = step.effect
    rows = [["equation", effect.equation], ["physics", effect.physics]]
    rows += [
        [
            parameter.name,
            f"{parameter.value:.4g} +- {parameter.std:.2g}"
            + ("" if parameter.unit == "1" else f" {parameter.unit}")
            + ("" if parameter.plausible else ", implausible"),
        ]
        for parameter in step.parameters
    ]
    rows += [[name, f"{value:.4g}, searched"] for name, value in step.fitted.constants.items()]
    rows += [
        ["explains", f"{100 * step.explained_fraction:.0f} % of what was left above the noise"],
        ["error on rows left out", f"{step.heldout_rms_um:.3g} um"],
        ["by chance", f"{step.p_value:.3g}, corrected for every effect that was tried"],
        ["rivals", ", ".join(f"{rival.name} ({100 * rival.cosine:.1f} % alike)" for rival in step.rivals) or "none"],
        ["told apart by", effect.separated_by],
    ]
    drivers = _drivers(effect, diagnosis.before)
    return [
        Panel(
            f"{number}. {effect.id}: the error against what drives it, before",
            "Dots are rows, lines are means.",
            _plot_error(diagnosis.before, drivers),
        ),
        Panel(
            f"{effect.id}: the same after",
            "Nothing should be left that follows the driver.",
            _plot_error(diagnosis.after, drivers),
        ),
        Panel(
            f"{effect.id}: its numbers",
            "The effect with the numbers fitted on this recording.",
            PageTable(("", ""), rows),
        ),
    ]


def _drivers(effect: Effect, comparison: Comparison) -> list[Covariate]:
    """What drives an effect, among what can be drawn; place and link lengths where there is nothing else."""
    candidates = covariates(comparison.aligned)
    names = {_covariate_name(quantity) for quantity in needed_quantities(effect, comparison.aligned.rows.links)}
    drivers = [covariate for covariate in candidates if covariate.name in names]
    if "direction" in effect.needs:
        drivers += [covariate for covariate in candidates if covariate.name.startswith("direction")]
    if "time" in effect.needs:
        drivers += [covariate for covariate in candidates if covariate.name == "time"]
    return drivers or [
        covariate
        for covariate in candidates
        if covariate.name in ("x", "y", "z") or covariate.name.startswith("length")
    ]


def _dependences(diagnosis: Diagnosis) -> Panel:
    rows = []
    for finding in diagnosis.depends_on:
        share = f"{100 * finding.explained_fraction:.3g} %"
        left, p_value = f"{finding.heldout_rms_um:.3g}", f"{finding.p_value:.3g}"
        rows.append([_covariate_text(finding), finding.form, finding.port, share, left, p_value])
    head = ("follows", "form", "port", "explains on rows left out", "left, um", "chance")
    return Panel(
        "What the rest follows",
        "A description, not a cause: the library has no effect that does this.",
        PageTable(head, rows),
    )


def _covariate_text(finding: EmpiricalFinding) -> str:
    return " with ".join([finding.covariate, *finding.beside])


def _rest_against(diagnosis: Diagnosis) -> list[Panel]:
    """The rest against what it follows; nothing for what has no picture (each link's own speed or force)."""
    first = diagnosis.depends_on[0]
    names = {_covariate_name(name) for name in (first.covariate, *first.beside)}
    drawn = [
        covariate
        for covariate in covariates(diagnosis.after.aligned)
        if covariate.name in names or covariate.name.split(" of ")[0] in names
    ]
    if not drawn:
        return []
    return [
        Panel(
            f"The rest against {_covariate_text(first)}",
            "Dots are rows, lines are means.",
            _plot_error(diagnosis.after, drawn),
        )
    ]


def _plot_error(comparison: Comparison, drivers: Sequence[Covariate]) -> Figure | PageTable:
    """The residual of each coordinate against what drives it."""
    return small_multiples(comparison, drivers, comparison.residual_um, comparison.aligned.labels, "error, um")


def _covariate_name(quantity: str) -> str:
    """The covariate's name of a quantity: without its unit; a tip's coordinate by its letter."""
    return quantity.removesuffix(f"_{unit_of(quantity)}").removeprefix("tip_")


def _formula(diagnosis: Diagnosis) -> Panel:
    lines = [
        line
        for effect in diagnosis.depends_on[0].formula_effects
        for line in yaml.safe_dump(effect, sort_keys=False, default_flow_style=None, width=100).splitlines()
    ]
    caption = "Ready to paste: it lowers the error until the cause is known."
    return Panel("As a formula effect", caption, PageTable(("",), [[line.replace("  ", "\u00a0 ")] for line in lines]))


def _candidates(candidates: Sequence[CandidateResult]) -> Panel:
    rows = [
        [
            result.effect,
            result.status.replace("_", " "),
            _percent(result.explained_fraction),
            _um(result.heldout_rms_um),
            result.why,
        ]
        for result in candidates
    ]
    head = ("effect", "status", "explains alone", "left, um", "why")
    return Panel("Every effect of the library", "Each tried alone, on rows left out.", PageTable(head, rows))


def _next_rows(diagnosis: Diagnosis) -> Panel:
    names = list(diagnosis.next_measurement[0])
    rows = [[str(row.get(name, "")) for name in names] for row in diagnosis.next_measurement]
    return Panel("What to measure next", "Rows that tell the most, in any order.", PageTable(names, rows))


def _percent(share: float) -> str:
    return f"{100 * max(share, 0.0):.0f} %" if math.isfinite(share) else "-"


def _um(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"
