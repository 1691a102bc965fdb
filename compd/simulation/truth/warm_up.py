"""Temperatures of the machine's bodies: links, base, columns, platform, tool, surface plate, rods.

Sizes are those of a machine of half a metre; `C` J/K, `G` W/K. Steel and iron: 460 J/(kg K),
50 W/(m K); granite: 800 J/(kg K), 2.8 W/(m K), 2900 kg/m3; still air over painted metal, convection and
radiation together: 8 W/(m2 K).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compd.simulation.truth.heat import HeatNetwork
from compd.simulation.truth.weather import Weather

Floats = NDArray[np.float64]

# Places with a thermometer beside the links; each can be held at a temperature.
PARTS = ("base", "platform", "tool", "frame", "plate_top", "plate_bottom")
LINK_PIECES = 5
COLUMN_STOREYS = 4
COLUMNS = 3
PLATE_LAYERS = 5
_FACES = ("inner", "outer")

# Heat of a drive that holds its link and that moves it, of electronics on the base ring, of the electrical cabinet
# on each column's outer face (it stands beside column 1), of lamps over the plate.
_DRIVE_HOLDING_W = 0.3
_DRIVE_MOVING_W = 1.2
# Distribution of a drive's heat over its link's pieces: a third at the motor near the base end, the rest evenly.
_DRIVE_SHARES = np.array([2, 7, 2, 2, 2]) / 15
_RING_W = 12.0
_CABINET_W = (8.0, 3.0, 4.0)
_PLATFORM_W = 0.4
_LAMPS_W = 3.0


@dataclass(frozen=True)
class Heat:
    """Heat sources, W. drives_W : (n,) per link, without the heat of moving it. cabinet_W : (3,) per column."""

    drives_W: Floats
    ring_W: float
    cabinet_W: Floats
    platform_W: float
    tool_W: float
    lamps_W: float


def usual_heat(links: int, share: float) -> Heat:
    """Heat of this machine's drives and electronics in normal use, times `share`."""
    return Heat(
        np.full(links, share * _DRIVE_HOLDING_W),
        share * _RING_W,
        share * np.array(_CABINET_W),
        share * _PLATFORM_W,
        0.0,
        share * _LAMPS_W,
    )


# Longest step: weather changes over minutes, and each step takes the room temperature at its middle.
MAX_STEP_S = 20.0


class WarmUp:
    """Temperatures of every body after switch-on; at time 0, when machine zero is taken, all are as the room is."""

    def __init__(self, links: int, weather: Weather, heat_share: float) -> None:
        self._weather = weather
        self.zero_degC = weather.at_zero.temperature_degC
        self.time_s = 0.0
        self._links = [[f"link_{i + 1}_{k}" for k in range(LINK_PIECES)] for i in range(links)]
        self._columns = [
            {face: [f"column_{i + 1}_{face}_{k}" for k in range(COLUMN_STOREYS)] for face in _FACES}
            for i in range(COLUMNS)
        ]
        self._plate = [f"plate_{k}" for k in range(PLATE_LAYERS)]
        self._network = self._build()
        index = self._network.index
        self._at_link = np.array([[index[name] for name in pieces] for pieces in self._links])
        self._at_column = np.array([[[index[n] for n in column[face]] for face in _FACES] for column in self._columns])
        self._at_plate = np.array([index[name] for name in self._plate])
        columns = [name for column in self._columns for face in _FACES for name in column[face]]
        self._places: dict[str, Sequence[str]] = {
            **{f"link_{i + 1}": pieces for i, pieces in enumerate(self._links)},
            **dict(
                zip(PARTS, (["base"], ["platform"], ["tool"], columns, self._plate[:1], self._plate[-1:]), strict=True)
            ),
        }
        middles = {f"link_{i + 1}": pieces[LINK_PIECES // 2] for i, pieces in enumerate(self._links)}
        single = middles | {body: body for body in ("base", "platform", "tool")}
        faces = {"plate_top": self._plate[0], "plate_bottom": self._plate[-1]}
        # place in the network by a thermometer's name: before and after that of the frame, which no single body has
        self._on_bodies, self._on_plate = (
            {f"temperature_{place}_degC": index[body] for place, body in of.items()} for of in (single, faces)
        )
        self.heat = usual_heat(links, heat_share)
        self._moving_W: Floats = np.zeros(len(index))
        self._moving_W[self._at_link] = heat_share * _DRIVE_MOVING_W * _DRIVE_SHARES

    def advance(self, time_s: float, moving_share: float) -> None:
        """Advance by `time_s`; the drives moved during `moving_share` of it."""
        heat_W = self._standing_W() + moving_share * self._moving_W
        steps = max(1, int(np.ceil(time_s / MAX_STEP_S)))
        for _ in range(steps):
            step_s = time_s / steps
            self._network.advance(step_s, self._weather.room_degC(self.time_s + step_s / 2), heat_W)
            self.time_s += step_s

    def hold(self, places_degC: Mapping[str, float]) -> None:
        """Hold these places, and no others, from now on. Names: link_1 .. and PARTS."""
        self._network.hold({body: degC for place, degC in places_degC.items() for body in self._places[place]})

    @property
    def bodies_degC(self) -> Floats:
        """(bodies,) temperatures; another array after each step."""
        return self._network.temperature_degC

    @property
    def room_degC(self) -> float:
        return self._weather.room_degC(self.time_s)

    def since_zero_K(self, body: str) -> float:
        """Mean temperature of base, platform, tool or rods since machine zero."""
        return float(self._network.temperature_degC[self._network.index[body]]) - self.zero_degC

    @property
    def links_K(self) -> Floats:
        """(n,) mean of each link since machine zero."""
        return np.asarray(self._network.temperature_degC[self._at_link].mean(axis=1) - self.zero_degC)

    @property
    def link_pieces_K(self) -> Floats:
        """(n, pieces) since machine zero, from the base end on."""
        return np.asarray(self._network.temperature_degC[self._at_link] - self.zero_degC)

    @property
    def columns_K(self) -> Floats:
        """(3, 2, storeys) since machine zero: column, inner and outer face, from the foot up."""
        return np.asarray(self._network.temperature_degC[self._at_column] - self.zero_degC)

    @property
    def plate_K(self) -> Floats:
        """(layers,) since machine zero, from the top down."""
        return np.asarray(self._network.temperature_degC[self._at_plate] - self.zero_degC)

    def thermometers_degC(self) -> dict[str, float]:
        """Reading of a thermometer at each place, without noise, as `temperature_<place>_degC`.

        A link's thermometer is at its middle; the frame's shows the mean of the columns.
        """
        bodies_degC = self._network.temperature_degC.tolist()
        return {
            "temperature_room_degC": self.room_degC,
            **{name: bodies_degC[body] for name, body in self._on_bodies.items()},
            "temperature_frame_degC": self.zero_degC + float(self.columns_K.mean()),
            **{name: bodies_degC[body] for name, body in self._on_plate.items()},
        }

    def _standing_W(self) -> Floats:
        """(bodies,) heat that does not depend on motion."""
        index, heat = self._network.index, self.heat
        heat_W = np.zeros(len(index))
        heat_W[self._at_link] = heat.drives_W[:, None] * _DRIVE_SHARES
        heat_W[self._at_column[:, 1, :]] = heat.cabinet_W[:, None] / COLUMN_STOREYS
        for body, watts in (
            ("base", heat.ring_W),
            ("platform", heat.platform_W),
            ("tool", heat.tool_W),
            (self._plate[0], heat.lamps_W),
        ):
            heat_W[index[body]] = watts
        return heat_W

    def _build(self) -> HeatNetwork:
        """Capacities and conductances of all bodies, from their sizes."""
        # base ring 25 kg, platform 8 kg, tool 0.15 kg, nine rods of 0.05 kg
        capacity = {"base": 11500.0, "platform": 3700.0, "tool": 70.0, "rods": 210.0}
        to_room = {"base": 3.2, "platform": 0.6, "tool": 0.05, "rods": 0.6}
        between = [("platform", "tool", 0.05)]
        for pieces in self._links:  # a tube of 3 kg, 0.1 m2; joints conduct badly
            capacity |= dict.fromkeys(pieces, 1380.0 / LINK_PIECES)
            to_room |= dict.fromkeys(pieces, 0.75 / LINK_PIECES)
            between += [(a, b, 0.3) for a, b in itertools.pairwise(pieces)]
            between += [("base", pieces[0], 0.2), (pieces[-1], "platform", 0.2)]
        for column in self._columns:  # 30 kg and 0.35 m2 each; the outer face stands towards the room
            for face, metres2 in (("inner", 0.15), ("outer", 0.20)):
                storeys = column[face]
                capacity |= dict.fromkeys(storeys, 6900.0 / COLUMN_STOREYS)
                to_room |= dict.fromkeys(storeys, 8.0 * metres2 / COLUMN_STOREYS)
                between += [(a, b, 0.8) for a, b in itertools.pairwise(storeys)]
            between += [(a, b, 1.5) for a, b in zip(column["inner"], column["outer"], strict=True)]
            between += [(column[face][-1], "base", 0.5) for face in _FACES]
        # granite, 0.64 m2, 0.2 m thick; the bottom stands on three feet over a closed stand
        capacity |= dict.fromkeys(self._plate, 297000.0 / PLATE_LAYERS)
        to_room |= {self._plate[0]: 5.0, self._plate[-1]: 2.0}
        between += [(a, b, 45.0) for a, b in itertools.pairwise(self._plate)]
        return HeatNetwork(capacity, to_room, between, self.zero_degC)
