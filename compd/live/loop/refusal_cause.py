"""Who makes a cycle impossible to compute: an effect, or a gauge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from compd.compensation import GaugeValues, WarmStart
from compd.live.loop.commands import Target
from compd.live.loop.models import compensate
from compd.live.machine import MachineWires
from compd.model import MachineModel, carry_over
from compd.text import number_text
from compd.units import UM_PER_MM

# A joint runs out and a frame grows by some hundredths of a millimetre: a change beyond this, mm, is no measurement.
_IMPLAUSIBLE_MM = 1.0


def refusal_cause(
    machine: MachineModel, values: GaugeValues, target: Target | None, warm_start: WarmStart, wires: MachineWires
) -> str:
    """The effect or gauge by which `values` cannot be computed, for people; "" where it is not known.

    machine : with the effects that are applied. warm_start : with which the cycle began.
    """
    without = replace(machine, effects=())
    if int(compensate(without, values, target, _for(warm_start, machine, without))[0].reason):
        change_mm = np.concatenate([values.joint_mm, values.frame_mm])
        if not len(change_mm):
            return ""
        worst = int(np.argmax(np.abs(change_mm)))
        wire = wires.comparators.wires[worst]
        if abs(change_mm[worst]) > _IMPLAUSIBLE_MM:
            away = number_text(UM_PER_MM * float(change_mm[worst]), "um", 3)
            return f"{wire.meaning} ({wire.channel}) is {away} from machine zero"
        return ""
    for fitted in machine.live_effects:
        alone = replace(machine, effects=(fitted,))
        if int(compensate(alone, values, target, _for(warm_start, machine, alone))[0].reason):
            return f"effect {fitted.effect.id}"
    return ""


def _for(warm_start: WarmStart, machine: MachineModel, other: MachineModel) -> WarmStart:
    return warm_start._replace(effects=carry_over(warm_start.effects, machine, other))
