"""The next measurement: the rows on which rival effects differ most, within limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from compd.api.arguments import Effects, Model, Recorded, opened_model, opened_recording
from compd.comparison import AlignedRecording, compare, search_constants
from compd.errors import CompdError, Problem
from compd.model.library import gather_effects, named_effect
from compd.planning import MeasurementPlan, ProgrammeLimits, plan_ways, recorded_limits
from compd.planning import plan_measurement as plan_fitted_rivals

# Lowest and highest.
Range: TypeAlias = tuple[float, float]


def plan_measurement(
    recording: Recorded,
    rivals: Sequence[str],
    *,
    rows: int = 40,
    model: Model = None,
    effects: Effects = (),
    beside: Sequence[str] = (),
    workspace_M_mm: tuple[Range, Range, Range] | None = None,
    force_N: float | None = None,
    temperature_degC: Range | None = None,
    speed_mm_per_s: float | None = None,
    limits: Mapping[str, Range] | None = None,
) -> MeasurementPlan:
    """Plan the rows (poses, loads, temperatures, speeds) on which rival effects differ most.

    Parameters
    ----------
    recording : AlignedRecording, str or Path
        What was measured so far; the effects are fitted on it.
    rivals : sequence of str
        Ids of two effects or more that the recording cannot tell apart, as a diagnosis names them.
    rows : int
        How many rows may be measured at most.
    model : ModelFile, str or Path, optional
        What is known already.
    effects : str, Path, Effect, or a sequence of these
        Effects of your own, which `rivals` and `beside` may name, as for `diagnose`.
    beside : sequence of str
        Ids of other effects that act on the recording and are not in the model, such as the other steps of a diagnosis;
        they are fitted along.
    workspace_M_mm : three pairs of float, optional
        Lowest and highest x, y and z of the tip in {M}, mm; left out, as in the recording.
    force_N : float, optional
        Largest load along any axis, N; left out, as in the recording.
    temperature_degC : (float, float), optional
        Lowest and highest temperature, degC; left out, as in the recording.
    speed_mm_per_s : float, optional
        Fastest motion of a link, mm/s; left out, as in the recording.
    limits : dict, optional
        With ``machine: external``, in place of the four above: lowest and highest value of a column that the rivals are
        computed from; of a column that is left out, as in the recording.

    Returns
    -------
    MeasurementPlan
        The rows, by how much the effects will differ on them, and the pairs that no rows within the limits tell apart.

    Raises
    ------
    CompdError
        Where the rivals are not two different effects or more, or one of them is in the model already; where a limit is
        no rising pair, negative, or for another kind of machine; where the effects cannot be fitted on this recording.
    RecordingError
        Where a place within the limits cannot be reached.

    Notes
    -----
    The criterion is T-optimality: A. C. Atkinson, V. V. Fedorov, Biometrika 62 (1975) 57.

    Examples
    --------
    >>> import compd
    >>> elastic = ["link_elasticity=60"]  # N/um
    >>> files = compd.simulate_campaign("tripod-cmm", "loads.csv", seed=5, effects=elastic)
    >>> rivals = ("link_elasticity", "joint_contact")
    >>> plan = compd.plan_measurement("loads.csv", rivals, rows=20, force_N=100.0)
    >>> print(f"{plan.before:.0f} -> {plan.separation:.0f}")  # standard deviations of the noise
    20 -> 26
    >>> plan.write("next.csv")
    """
    if len(rivals) < 2 or len(set(rivals)) < len(rivals):
        raise CompdError.of(
            "rivals",
            "needs two effects or more",
            value=",".join(rivals),
            allowed="different ids",
            next_step="a diagnosis names rivals",
        )
    own = gather_effects(effects)
    contending, others = ([named_effect(name, "rivals", own) for name in names] for names in (rivals, beside))
    aligned = opened_recording(recording)
    file = opened_model(model, aligned)
    present = [fitted.effect.id for fitted in file.fitted if fitted.effect.id in (*rivals, *beside)]
    if present:
        raise CompdError.of(
            "rivals",
            "is in the model already",
            value=", ".join(present),
            allowed="effects that are not",
            next_step="`compd model remove` takes it out",
        )
    given = _plan_limits(aligned, workspace_M_mm, force_N, temperature_degC, speed_mm_per_s, limits or {})
    sigma_um = compare(aligned, file.fitted, file.covariance).floor.by_axis_um
    fitted = file.fitted
    for effect in others:
        fitted = search_constants(aligned, fitted, effect, sigma_um).fitted
    models = [search_constants(aligned, fitted, effect, sigma_um).fitted for effect in contending]
    plan = plan_fitted_rivals(aligned, models[0][:-1], [model[-1] for model in models], sigma_um, given, rows)
    return plan if aligned.model is None else replace(plan, ways=plan_ways(aligned.model, plan.rows))


def _plan_limits(
    aligned: AlignedRecording,
    workspace_M_mm: tuple[Range, Range, Range] | None,
    force_N: float | None,
    temperature_degC: Range | None,
    speed_mm_per_s: float | None,
    by_column: Mapping[str, Range],
) -> ProgrammeLimits | Mapping[str, Range]:
    """The limits that a plan keeps.

    Raises CompdError with every one that is faulty, or for the other kind of machine.
    """
    pairs = {f"workspace_M_mm, {axis}": pair for axis, pair in zip("xyz", workspace_M_mm or (), strict=False)}
    if temperature_degC is not None:
        pairs["temperature_degC"] = temperature_degC
    largest = {"force_N": force_N, "speed_mm_per_s": speed_mm_per_s}
    given: dict[str, Any] = {name: value for name, value in largest.items() if value is not None}
    problems = [
        Problem(name, "is not understood", value=str(pair), allowed="two numbers, low before high")
        for name, pair in pairs.items()
        if not (len(pair) == 2 and pair[0] < pair[1])
    ]
    problems += [
        Problem(f"limit of {name}", "is not understood", value=str(pair), allowed="two numbers, low first")
        for name, pair in by_column.items()
        if not (len(pair) == 2 and pair[0] <= pair[1])
    ]
    problems += [
        Problem(name, "is not understood", value=str(value), allowed="0 or more")
        for name, value in given.items()
        if not value >= 0
    ]
    external = aligned.model is None
    problems += [
        Problem(
            name,
            "is a limit of an external machine" if not external else "is no limit of an external machine",
            allowed="limits by column" if external else "workspace, force, temperature and speed",
            next_step="give `--limit COLUMN=LOW,HIGH`, in Python limits={COLUMN: (LOW, HIGH)}" if external else "",
        )
        for name in ([*pairs, *given] if external else [f"limit of {name}" for name in by_column])
    ]
    if problems:
        raise CompdError(problems)
    if external:
        return by_column
    if workspace_M_mm is not None:
        low_M_mm, high_M_mm = np.array(workspace_M_mm, dtype=np.float64).T
        given |= {"tip_low_M_mm": low_M_mm, "tip_high_M_mm": high_M_mm}
    if temperature_degC is not None:
        given["temperature_degC"] = temperature_degC
    return recorded_limits(aligned)._replace(**given)
