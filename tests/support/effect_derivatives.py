"""How a prediction changes with an effect's fitted numbers, by the chain rule over its ports."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.model import Sensitivity, split_by_port
from compd.model.effects import Effect, Observations, Port


def effect_sensitivity(
    effect: Effect, rows: Observations, basis: FloatArray, by_port: Mapping[Port, Sensitivity]
) -> Sensitivity:
    """The prediction's derivatives by an effect's P fitted numbers: (N, 3, P), (N, 3, P), (N, n, P).

    basis : (N, sum of port sizes, P), from `effect.basis`.  by_port : from `sensitivities`, for the effect's ports.
    """
    parts = [(by_port[port], values) for port, values in split_by_port(effect, rows, basis).items()]
    tip, rotation, link_length = (
        sum((sensitivity[i] @ values for sensitivity, values in parts), start=np.zeros(())) for i in range(3)
    )
    return Sensitivity(tip, rotation, link_length)
