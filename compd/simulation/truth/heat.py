"""A network of heat capacities, solved exactly between changes of its surroundings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from compd.simulation.truth.weather import REFERENCE_degC

Floats = NDArray[np.float64]

# A body that is held warm or cold, by a mat of heaters or a jacket of water, is there within a minute.
HELD_TIME_CONSTANT_S = 10.0


class HeatNetwork:
    """C_i dT_i/dt = sum_j G_ij (T_j - T_i) + G_room,i (T_room - T_i) + q_i, decomposed into its modes.

    Constant room and heat over a step make the step exact, whatever its length.
    """

    def __init__(
        self,
        capacity_J_per_K: Mapping[str, float],
        to_room_W_per_K: Mapping[str, float],
        between_W_per_K: Sequence[tuple[str, str, float]],
    ) -> None:
        """Every body by name; every path of heat between two of them, and to the room."""
        self.index = {name: i for i, name in enumerate(capacity_J_per_K)}
        self._capacity = np.array(list(capacity_J_per_K.values()))
        self._to_room = np.array([to_room_W_per_K.get(name, 0.0) for name in capacity_J_per_K])
        conductance = np.diag(self._to_room)
        for first, second, watts in between_W_per_K:
            i, j = self.index[first], self.index[second]
            conductance[[i, j], [i, j]] += watts
            conductance[[i, j], [j, i]] -= watts
        self._conductance = conductance
        self.temperature_degC: Floats = np.full(len(self._capacity), REFERENCE_degC)
        self.hold({})

    def hold(self, temperature_degC: Mapping[str, float]) -> None:
        """From now on these bodies, and no others, are held at their temperatures."""
        to_jacket, self._held_W = np.zeros(len(self.index)), np.zeros(len(self.index))
        for name, degC in temperature_degC.items():
            body = self.index[name]
            to_jacket[body] = self._capacity[body] / HELD_TIME_CONSTANT_S
            self._held_W[body] = to_jacket[body] * degC
        conductance = self._conductance + np.diag(to_jacket)
        # C^-1/2 K C^-1/2 is symmetric: real decay rates, orthogonal modes.
        root = np.sqrt(self._capacity)
        self._rates_per_s, modes = np.linalg.eigh(conductance / np.outer(root, root))
        self._from_modes = modes / root[:, None]
        self._to_modes = modes.T * root
        self._resistance = np.linalg.inv(conductance)

    def steady_degC(self, room_degC: float, heat_W: Floats) -> Floats:
        """Where the temperatures would settle, (bodies,)."""
        return self._resistance @ (self._to_room * room_degC + heat_W + self._held_W)

    def advance(self, time_s: float, room_degC: float, heat_W: Floats) -> None:
        """Let `time_s` pass with the room and the heat (bodies,) as given."""
        steady = self.steady_degC(room_degC, heat_W)
        decayed = np.exp(-self._rates_per_s * time_s) * (self._to_modes @ (self.temperature_degC - steady))
        self.temperature_degC = steady + self._from_modes @ decayed
