"""Commands of clients to the loop: machine zero, target and models."""

from __future__ import annotations

from dataclasses import dataclass

from compd.errors import StateError
from compd.live.loop.machine_zero import MachineZero
from compd.live.loop.model_loader import Models


@dataclass(frozen=True)
class Target:
    """Where a controller wants the tip.

    tip_mm : (3), in {B0}; with the tool on the plate the place on the work, in {P}.
    rotation_B0_rad : (3), rotation vector of {P} in {B0}; None for the attitude at machine zero. The attitude of a
        tripod follows from its tip.
    """

    tip_mm: tuple[float, ...]
    rotation_B0_rad: tuple[float, ...] | None = None


@dataclass
class Commands:
    """What the loop reads at the start of every cycle. Each field has one writer, which replaces an immutable value.

    zero : written where machine zero is taken; StateError says why there is none.
    target : written by the publisher for the controller; None is CMM mode.
    models : written where models are read; None is the machine without effects.
    """

    zero: MachineZero | StateError
    target: Target | None = None
    models: Models | None = None
