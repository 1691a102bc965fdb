"""What clients ask of the loop: machine zero, a target, models; adopted between two ticks."""

from __future__ import annotations

from dataclasses import dataclass

from compd.errors import StateError
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.model_loader import Models


@dataclass(frozen=True)
class Target:
    """Where the controller wants the tip.

    tip_mm : in {B0}, or in {P} with the tool on the plate. rotation_B0_rad : rotation vector of {P} in {B0};
    None for the attitude at machine zero (a tripod's follows from its tip).
    """

    tip_mm: tuple[float, ...]
    rotation_B0_rad: tuple[float, ...] | None = None


@dataclass
class Commands:
    """What the loop adopts between two ticks. Each slot holds an immutable value, swapped by reference.

    zero : written by whoever takes machine zero; StateError says why there is none.
    target : written by the publisher for the controller; None is CMM mode.
    models : written by whoever adopts models; None is the machine without effects.
    """

    zero: MachineZero | StateError
    target: Target | None = None
    models: Models | None = None
