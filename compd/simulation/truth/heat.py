"""A network of heat capacities, solved exactly while room temperature and heat are constant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Time constant of a body that heaters or a water jacket hold at a temperature.
HELD_TIME_CONSTANT_S = 10.0


class HeatNetwork:
    """C_i dT_i/dt = sum_j G_ij (T_j - T_i) + G_room,i (T_room - T_i) + q_i, solved by its modes.

    With room temperature and heat constant over a step the solution is exact, whatever the step's length.
    """

    def __init__(
        self,
        capacity_J_per_K: Mapping[str, float],
        to_room_W_per_K: Mapping[str, float],
        between_W_per_K: Sequence[tuple[str, str, float]],
        start_degC: float,
    ) -> None:
        """capacity, to_room : by body. between : pairs of bodies with their conductance. start : of all bodies."""
        self.index = {name: i for i, name in enumerate(capacity_J_per_K)}
        self._capacity = np.array(list(capacity_J_per_K.values()))
        self._to_room = np.array([to_room_W_per_K.get(name, 0.0) for name in capacity_J_per_K])
        conductance = np.diag(self._to_room)
        for first, second, watts in between_W_per_K:
            i, j = self.index[first], self.index[second]
            conductance[[i, j], [i, j]] += watts
            conductance[[i, j], [j, i]] -= watts
        self._conductance = conductance
        self.temperature_degC: Floats = np.full(len(self._capacity), start_degC)
        self.hold({})

    def hold(self, temperature_degC: Mapping[str, float]) -> None:
        """Hold these bodies, and no others, at these temperatures from now on."""
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
        self._decay: tuple[float, Floats] = 0.0, np.ones(len(self.index))  # of the modes, over the last step's time

    def steady_degC(self, room_degC: float, heat_W: Floats) -> Floats:
        """(bodies,) steady state for this room temperature and heat (bodies,)."""
        return self._resistance @ (self._to_room * room_degC + heat_W + self._held_W)

    def advance(self, time_s: float, room_degC: float, heat_W: Floats) -> None:
        """Advance by `time_s` at constant room temperature and heat (bodies,)."""
        if time_s != self._decay[0]:
            self._decay = time_s, np.exp(-self._rates_per_s * time_s)
        steady = self.steady_degC(room_degC, heat_W)
        decayed = self._decay[1] * (self._to_modes @ (self.temperature_degC - steady))
        self.temperature_degC = steady + self._from_modes @ decayed
