"""The next measurement: rows that answer what a recording leaves open, or what to measure where no rows can."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np

from compd.arrays import FloatArray
from compd.comparison import AlignedRecording
from compd.errors import CompdError, Problem
from compd.model.effects import ConstantValues, Effect, FittedEffect, needed_quantities, unmet_needs
from compd.planning.measurement_plan import MeasurementPlan, NextMeasurement, as_factor
from compd.planning.measurement_planner import MeasurementPlanner
from compd.planning.measurement_programmes import ProgrammeLimits, machine_programmes, recorded_limits
from compd.planning.measurement_settings import SettingLimits
from compd.planning.planning_criteria import PlanningCriteria
from compd.planning.programme_rows import ProgrammeRows
from compd.planning.setting_programmes import setting_programmes


def plan_measurement(
    aligned: AlignedRecording,
    model: Sequence[FittedEffect],
    rivals: Sequence[FittedEffect],
    sigma_um: FloatArray,
    limits: ProgrammeLimits | SettingLimits,
    rows: int,
    criteria: PlanningCriteria = PlanningCriteria(),
) -> MeasurementPlan:
    """The rows on which fitted rivals differ most, however the other ones are refitted.

    The criterion is T-optimality (`compd.planning.t_optimal`), with each rival as the truth; the smallest of
    the sums of squares counts. Effects of the model, constants and the instrument's frame are refitted along, and the
    recording's rows count. Of three rivals or more, pairs that no rows within the limits tell apart are named, and the
    rows are for the others.

    model : effects that are fitted along.  rivals : two or more, fitted on the recording.  sigma_um : (m,) noise.
    limits : of a machine whose kinematics is known ProgrammeLimits; of an external one the columns' limits, where they
        are not those of the recording.
    rows : how many may be measured at most.

    Raises RecordingError where a place within the limits cannot be reached; CompdError where a limit is faulty.

    Example::

        plan = plan_measurement(aligned, (), (spring, contact), sigma_um, recorded_limits(aligned), rows=30)
        plan.before, plan.separation  # by how many standard deviations the two differ, before and after
    """
    effects = [fitted.effect for fitted in rivals]
    possible = _programmes(aligned, effects, model, limits)
    planner = MeasurementPlanner(aligned, model, sigma_um, possible, criteria=criteria)
    contenders = [planner.contender(fitted) for fitted in rivals]
    plan = planner.plan(list(permutations(contenders, 2)), rows, _words(effects))
    if len(rivals) == 2 or plan.is_wide_enough:
        return plan
    pairs = list(combinations(contenders, 2))
    apart = [
        (first, second)
        for first, second in pairs
        if planner.plan([(first, second), (second, first)], rows).is_wide_enough
    ]
    alike = tuple((first.name, second.name) for first, second in pairs if (first, second) not in apart)
    if apart:
        plan = planner.plan([pair for first, second in apart for pair in ((first, second), (second, first))], rows)
    return replace(plan, rivals=_ids(effects), separated_by=_words(effects), alike=alike)


def next_measurement(
    aligned: AlignedRecording,
    model: Sequence[FittedEffect],
    found: FittedEffect,
    rival: Effect,
    sigma_um: FloatArray,
    constants: ConstantValues | None = None,
    criteria: PlanningCriteria = PlanningCriteria(),
) -> NextMeasurement:
    """What tells an effect from its rival: rows within the limits of the recording, or words.

    model : effects that are fitted along: the model's own, and the others that were found.
    found : the effect as fitted.  rival : taken with the numbers by which it imitates `found` best.
    sigma_um : (m,) noise; where more is left than noise, what is left.
    constants : nonlinear constants of the rival; None for those of its grid by which it imitates best.
    Of a rival of which a quantity was not measured, the words say what to measure.
    """
    effects = [found.effect, rival]
    if problems := _unmet(aligned, rival):
        return _gauges_to_add(effects, problems)
    try:
        possible = _programmes(aligned, effects, model)
    except CompdError as error:
        return _words_alone(effects, error)
    planner = MeasurementPlanner(aligned, model, sigma_um, possible, criteria=criteria)
    first = planner.contender(found)
    second = planner.imitation(first, rival, constants)
    return _rows_or_words(planner.plan([(first, second), (second, first)], criteria.rows, _words(effects)), effects)


def measurement_of_constant(
    aligned: AlignedRecording,
    model: Sequence[FittedEffect],
    causes: Sequence[Effect],
    constant_um: FloatArray,
    sigma_um: FloatArray,
    criteria: PlanningCriteria = PlanningCriteria(),
) -> NextMeasurement:
    """What parts the possible causes of a constant: rows on which they are none or another one, or words.

    causes : effects that make nothing but a constant on the recording.  constant_um : (m,) the constant.
    Each cause is taken with the numbers by which it imitates the constant best, and contends with every other one and
    with what is constant everywhere, such as the zero of the instrument. Two that no such rows part are left out.
    """
    try:
        possible = _programmes(aligned, causes, model)
    except CompdError as error:
        return _words_alone(causes, error)
    planner = MeasurementPlanner(aligned, model, sigma_um, possible, with_nuisance=False, criteria=criteria)
    constant = planner.constant(constant_um)
    contenders = [constant, *(planner.imitation(constant, cause) for cause in causes)]
    contests = [pair for pair in permutations(contenders, 2) if planner.plan([pair], criteria.rows).tells_apart]
    if not contests:
        why = "on all of them these remain one constant, but for less than the noise"
        return NextMeasurement(_ids(causes), None, _words(causes), why)
    return _rows_or_words(planner.plan(contests, criteria.rows, _words(causes)), causes)


def measurement_to_test(
    aligned: AlignedRecording,
    model: Sequence[FittedEffect],
    effect: Effect,
    sigma_um: FloatArray,
    criteria: PlanningCriteria = PlanningCriteria(),
) -> NextMeasurement:
    """What makes an effect testable that is not on this recording.

    Words where a quantity is not measured or stayed as it was; rows where the effect would be seen on them, at half of
    its largest plausible size.
    """
    if problems := _unmet(aligned, effect):
        return _gauges_to_add([effect], problems)
    if unvaried := _unvaried(aligned, effect):
        stayed = ", ".join(f"{name} stayed at {value:g}" for name, value in unvaried.items())
        return NextMeasurement((effect.id,), None, f"vary {', '.join(unvaried)}", stayed)
    try:
        possible = _programmes(aligned, [effect], model)
    except CompdError as error:
        return _words_alone([effect], error)
    planner = MeasurementPlanner(aligned, model, sigma_um, possible, criteria=criteria)
    sizes = [
        criteria.expected_share * max(map(abs, column.parameter.theta_range))
        for column in effect.columns(aligned.rows.links)
    ]
    plans = [
        planner.plan(
            [(planner.contender(FittedEffect(effect, np.array(sizes), constants)), None)],
            criteria.rows,
            effect.separated_by,
        )
        for constants in effect.constant_grid(aligned.rows)
    ]
    return _rows_or_words(max(plans, key=lambda plan: plan.separation), [effect])


def _programmes(
    aligned: AlignedRecording,
    effects: Sequence[Effect],
    model: Sequence[FittedEffect],
    limits: ProgrammeLimits | SettingLimits | None = None,
) -> ProgrammeRows:
    """What could be measured next about the effects. limits : None for those of the recording.

    Raises CompdError where nothing could be.
    """
    if aligned.ends is not None:
        held = "within the length of the bar" if aligned.ends.of_lengths else "in its pins"
        raise CompdError.of(
            str(aligned.recording.path),
            f"rows are chosen all over the workspace, and this reference measures only {held}",
            allowed="a reference that follows the tip: tool_position, tool_pose, link_length",
            next_step="measure from further balls, at other heights, warm and cold"
            if aligned.ends.of_lengths
            else "measure at further pins, warm and cold, or with a reference that follows the tip",
        )
    if aligned.model is not None:
        given = limits if isinstance(limits, ProgrammeLimits) else recorded_limits(aligned)
        return machine_programmes(aligned, effects, given)
    by_column = {} if limits is None or isinstance(limits, ProgrammeLimits) else limits
    # what the model's effects are computed from is varied too: only then are these parted from the others
    possible = setting_programmes(aligned, [*effects, *(fitted.effect for fitted in model)], by_column)
    if not len(possible.lengths):
        raise CompdError.of(
            str(aligned.recording.path),
            "nothing that these effects are computed from was varied",
            value=", ".join(effect.id for effect in effects),
            next_step="record a column by which they differ, or give limits within which one can be varied",
        )
    return possible


def _unvaried(aligned: AlignedRecording, effect: Effect) -> dict[str, float]:
    """Quantity -> value of those that the effect needs; empty where one of them changed."""
    usable = aligned.usable.mask
    values = {}
    for name in needed_quantities(effect, aligned.rows.links):
        if name not in aligned.rows.quantities:
            continue
        known = aligned.rows.quantities[name][usable]
        known = known[np.isfinite(known)]
        if len(known) and np.ptp(known) > 0:
            return {}
        values[name] = float(known[0]) if len(known) else float("nan")
    return values


def _unmet(aligned: AlignedRecording, effect: Effect) -> list[Problem]:
    return unmet_needs(effect, aligned.rows.available, aligned.rows.links, aligned.rows.quantities_at_zero)


def _gauges_to_add(effects: Sequence[Effect], problems: Sequence[Problem]) -> NextMeasurement:
    measure = "; ".join(dict.fromkeys(problem.next_step for problem in problems))
    why = "; ".join(f"{problem.where} {problem.what}" for problem in problems)
    return NextMeasurement(_ids(effects), None, measure, why)


def _ids(effects: Sequence[Effect]) -> tuple[str, ...]:
    return tuple(effect.id for effect in effects)


def _words(effects: Sequence[Effect]) -> str:
    """What tells the effects from others, as they say it themselves."""
    return "; ".join(dict.fromkeys(effect.separated_by for effect in effects if effect.separated_by))


def _words_alone(effects: Sequence[Effect], error: CompdError) -> NextMeasurement:
    return NextMeasurement(_ids(effects), None, _words(effects), error.problems[0].what)


def _rows_or_words(plan: MeasurementPlan, effects: Sequence[Effect]) -> NextMeasurement:
    """The plan where it is worth measuring; else what is, and why, in words."""
    if plan.tells_apart:
        return NextMeasurement(_ids(effects), plan)
    if not plan.is_wide_enough:
        why = f"the best {len(plan.rows)} rows make a difference of {as_factor(plan.separation)} times the noise"
        why += f", and it takes {plan.criteria.min_separation:.2g}"
    else:
        why = f"the best {len(plan.rows)} rows add little to a difference of {as_factor(plan.before)} times the noise"
    return NextMeasurement(_ids(effects), None, plan.separated_by, why)
