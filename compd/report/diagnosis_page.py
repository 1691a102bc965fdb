"""A diagnosis as a page: the verdict, the evidence for each effect, every candidate, what to measure next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import yaml
from plotly.graph_objects import Figure

from compd.comparison.compare import Comparison
from compd.comparison.covariates import Covariate, covariates
from compd.diagnosis.holdout import Holdout
from compd.diagnosis.verdict import CandidateResult, Diagnosis, DiagnosisStep, EmpiricalFinding, in_um
from compd.model.effect import Effect
from compd.model.effect_needs import needed_quantities
from compd.report.page import COLOURS, PageTable, Panel, style_figure, write_page
from compd.report.small_multiples import small_multiples
from compd.units import unit_of


def write_diagnosis_page(path: Path, found: Diagnosis, sealed: Sequence[Holdout]) -> None:
    """Write the page; it works offline."""
    recording = found.before.aligned.recording
    panels = [_falling(found, sealed)]
    for number, step in enumerate(found.steps, start=1):
        panels += _of_step(number, step, found)
    if found.depends_on:
        panels += [_depends(found), *_against(found), _formula(found)]
    panels.append(_candidates(found.candidates))
    if found.next_measurement:
        panels.append(_next(found))
    footer = (
        f"{recording.path}, sha256 {recording.sha256[:16]}; {int(found.after.used.sum())} rows used; "
        f"noise floor: {found.before.floor.how}."
    )
    write_page(path, f"{recording.machine}: what is missing? {found.verdict}", found.summary, panels, footer)


def _falling(found: Diagnosis, sealed: Sequence[Holdout]) -> Panel:
    """Bars: the error as it was, with each effect, and on sealed recordings; the floor as a line."""
    names = ["as it was", *(f"with {one.effect.id}" for one in found.steps)]
    values = [found.before.rms_um, *(one.heldout_rms_um for one in found.steps)]
    colours = [COLOURS["worst"], *[COLOURS["middle"]] * (len(found.steps) - 1), COLOURS["best"]][: len(names)]
    for first in found.depends_on[:1]:
        names.append(f"described by {_follows(first)}")
        values.append(first.heldout_rms_um)
        colours.append(COLOURS["quiet"])
    for one in sealed:
        name = one.after.aligned.recording.path.name
        names += [f"{name}, before", f"{name}, after"]
        values += [one.before.rms_um, one.after.rms_um]
        colours += [COLOURS["quiet"], COLOURS["plain"]]
    figure = Figure()
    figure.add_bar(x=names, y=values, marker_color=colours, text=[in_um(value) for value in values], name="error")
    figure.add_hline(y=found.before.floor.um, line_dash="dot", annotation_text="noise alone")
    figure.update_layout(showlegend=False)
    caption = (
        "Error per coordinate, rms. With an effect or a description: on rows that were left out when its numbers were "
        "fitted."
    )
    return Panel("The falling error", caption, style_figure(figure, "", "error, um", 300))


def _of_step(number: int, step: DiagnosisStep, found: Diagnosis) -> list[Panel]:
    effect = step.effect
    rows = [["equation", effect.equation], ["physics", effect.physics]]
    rows += [
        [one.name, f"{one.value:.4g} +- {one.std:.2g} {one.unit}" + ("" if one.plausible else ", implausible")]
        for one in step.parameters
    ]
    rows += [[name, f"{value:.4g}, searched"] for name, value in step.fitted.constants.items()]
    rows += [
        ["explains", f"{100 * step.explained_fraction:.0f} % of what was left above the noise"],
        ["error on rows left out", f"{step.heldout_rms_um:.3g} um"],
        ["by chance", f"{step.p_value:.3g}, corrected for every effect that was tried"],
        ["rivals", ", ".join(f"{one.name} ({100 * one.cosine:.1f} % alike)" for one in step.rivals) or "none"],
        ["told apart by", effect.separated_by],
    ]
    drivers = _drivers(effect, found.before)
    return [
        Panel(
            f"{number}. {effect.id}", "The effect with the numbers fitted on this recording.", PageTable(("", ""), rows)
        ),
        Panel(
            f"{effect.id}: the error against what drives it, before",
            "Dots are rows, lines are means.",
            small_multiples(found.before, drivers, found.before.residual_um, found.before.aligned.labels, "error, um"),
        ),
        Panel(
            f"{effect.id}: the same after",
            "Nothing should be left that follows the driver.",
            small_multiples(found.after, drivers, found.after.residual_um, found.after.aligned.labels, "error, um"),
        ),
    ]


def _drivers(effect: Effect, comparison: Comparison) -> list[Covariate]:
    """What drives an effect, among what can be drawn; place and link lengths where there is nothing else."""
    every = covariates(comparison.aligned)
    needed = needed_quantities(effect, comparison.aligned.rows.links)
    names = {_name(name) for name in needed}
    found = [one for one in every if one.name in names]
    if "direction" in effect.needs:
        found += [one for one in every if one.name.startswith("direction")]
    if "time" in effect.needs:
        found += [one for one in every if one.name == "time"]
    return found or [one for one in every if one.name in ("x", "y", "z") or one.name.startswith("length")]


def _depends(found: Diagnosis) -> Panel:
    rows = []
    for one in found.depends_on:
        share = f"{100 * one.explained_fraction:.3g} %"
        rows.append([_follows(one), one.form, one.port, share, f"{one.heldout_rms_um:.3g}", f"{one.p_value:.3g}"])
    head = ("follows", "form", "port", "explains on rows left out", "left, um", "chance")
    return Panel(
        "What the rest follows",
        "A description, not a cause: the library has no effect that does this.",
        PageTable(head, rows),
    )


def _follows(one: EmpiricalFinding) -> str:
    return " with ".join([one.covariate, *one.beside])


def _against(found: Diagnosis) -> list[Panel]:
    """The rest against what it follows; nothing for what has no picture (each link's own speed or force)."""
    first = found.depends_on[0]
    drawn = {_name(name) for name in (first.covariate, *first.beside)}
    against = [
        one for one in covariates(found.after.aligned) if one.name in drawn or one.name.split(" of ")[0] in drawn
    ]
    if not against:
        return []
    picture = small_multiples(found.after, against, found.after.residual_um, found.after.aligned.labels, "error, um")
    return [Panel(f"The rest against {_follows(first)}", "Dots are rows, lines are means.", picture)]


def _name(covariate: str) -> str:
    """As pictures call it: without its unit; a tip's coordinate by its letter."""
    return covariate.removesuffix(f"_{unit_of(covariate)}").removeprefix("tip_")


def _formula(found: Diagnosis) -> Panel:
    lines = [
        line
        for one in found.depends_on[0].formula_effects
        for line in yaml.safe_dump(one, sort_keys=False, default_flow_style=None, width=100).splitlines()
    ]
    caption = "Ready to paste: it lowers the error until the cause is known."
    return Panel("As a formula effect", caption, PageTable(("",), [[line.replace("  ", "\u00a0 ")] for line in lines]))


def _candidates(candidates: Sequence[CandidateResult]) -> Panel:
    rows = [
        [one.effect, one.status.replace("_", " "), _percent(one.explained_fraction), _um(one.heldout_rms_um), one.why]
        for one in candidates
    ]
    head = ("effect", "status", "explains alone", "left, um", "why")
    return Panel("Every effect of the library", "Each tried alone, on rows left out.", PageTable(head, rows))


def _next(found: Diagnosis) -> Panel:
    names = list(found.next_measurement[0])
    rows = [[str(row.get(name, "")) for name in names] for row in found.next_measurement]
    return Panel("What to measure next", "Rows that tell the most, in any order.", PageTable(names, rows))


def _percent(share: float) -> str:
    return f"{100 * max(share, 0.0):.0f} %" if math.isfinite(share) else "-"


def _um(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "-"
