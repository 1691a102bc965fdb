"""Whether a configuration lets any setpoint be valid: the daemon's own cycle, with every gauge good and at rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from compd.commissioning.cycle_time import first_model, raw_value, zero_of
from compd.commissioning.drift_costs import target_at_zero
from compd.commissioning.line_budget import least_exchanges_s
from compd.configuration import Configuration
from compd.gauge import good
from compd.live.loop import CycleInputs, CycleState, Setpoint, Target, build_pipeline, radius_95, step
from compd.live.machine import Models
from compd.model import MachineModel
from compd.model.external import ExternalModel
from compd.reading import ReadingMotion

# Time of the cycle, and age of every reading in it, s.
_NOW_S, _AGE_S = 1e6, 1e-4
# Of a machine that has rested for long.
_AT_REST = ReadingMotion(0.0, 0.0, 0.0, horizon_s=1.0, due_s=1.0, rest_s=1e5)
# Reaches the correction of a model at once.
_SLEW_MM_PER_S = 1e9


def certain_refusal(configuration: Configuration) -> str:
    """Why every setpoint will be refused, as a sentence; "" where one can be valid.

    Both modes count, and the model of `state.model_file`. Raises CompdError if that cannot be used.
    """
    if late := _late_comparators(configuration):
        return f"Every setpoint will be refused: {late}."
    limit_um = configuration.limits.tip_error_um
    if limit_um is None:
        return ""
    refused = _setpoints_at_zero(configuration, limit_um)
    if any(setpoint.valid for setpoint in refused):
        return ""
    bounds_um = [setpoint.u_tip_um for setpoint in _setpoints_at_zero(configuration, None) if setpoint.valid]
    if len(bounds_um) < len(refused):  # this limit is not the reason
        return ""
    unknown = all(isinstance(bound_um, float) and math.isnan(bound_um) for bound_um in bounds_um)
    # the part that is the same wherever the tip is
    by_frame_um = radius_95(np.eye(3)) * configuration.wiring.unmeasured_frame_um
    where = "Every setpoint" if unknown or by_frame_um > limit_um else "At machine zero every setpoint"
    return f"{where} will be refused: {refused[0].reason}."


def _setpoints_at_zero(configuration: Configuration, tip_error_um: float | None) -> list[Setpoint]:
    """The setpoint of each mode with this limit, every gauge good and the machine at rest at machine zero."""
    pipeline = build_pipeline(configuration, configuration.gauge_objects())
    model, zero = first_model(configuration, pipeline.loader), zero_of(configuration, pipeline.wires)
    for channel, slot in pipeline.latest.index.items():
        reading = good(raw_value(zero, channel), _NOW_S - _AGE_S)
        is_length = channel in zero.readings_mm
        pipeline.latest.put(slot, reading._replace(motion=_AT_REST) if is_length else reading)
    limits = configuration.limits.model_copy(update={"slew_mm_per_s": _SLEW_MM_PER_S, "tip_error_um": tip_error_um})
    settings = replace(pipeline.settings, limits=limits)
    state, snapshot = CycleState.at_start(settings.model), pipeline.latest.snapshot(_NOW_S)
    return [
        step(state, CycleInputs(1, snapshot, zero, target, Models(model)), settings)[0]
        for target in _targets(configuration, settings.model)
    ]


def _targets(configuration: Configuration, model: MachineModel) -> Sequence[Target | None]:
    """The target of each mode at machine zero; None for CMM mode."""
    if isinstance(model, ExternalModel):
        rows = ((0.0,) * model.links,) * 3 if model.links else None
        return [None] if model.own is not None else [Target((0.0, 0.0, 0.0), tip_by_scale=rows)]
    target = Target(tuple(target_at_zero(model).tolist()))
    return [None, target] if configuration.wiring.scale else [target]


def _late_comparators(configuration: Configuration) -> str:
    """The comparators of one line that cannot be read within `loop.skew_s`; "" where there are none.

    Scales do not count: machine-tool mode does not need them.
    """
    skew_s = configuration.loop.skew_s
    if skew_s is None:
        return ""
    wired = [wire.gauge for wire in configuration.wiring.joint] + [wire.gauge for wire in configuration.wiring.frame]
    comparators = {channel.partition(".")[0] for channel in wired}
    for line, exchanges_s in least_exchanges_s(configuration).items():
        named = comparators & exchanges_s.keys()
        apart_s = (len(named) - 1) * min((exchanges_s[gauge] for gauge in named), default=0.0)
        if apart_s > skew_s:
            return (
                f"the comparators on line `{line}` are read {apart_s * 1e3:.3g} ms apart or more, "
                f"allowed {skew_s * 1e3:g} ms (`loop.skew_s`)"
            )
    return ""
