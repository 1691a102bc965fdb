"""Rows of a simulated campaign: readings of the gauges and of the reference, by column of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from compd.arrays import FloatArray
from compd.columns import (
    ATTITUDE_COLUMNS,
    COMMANDED_ATTITUDE_COLUMNS,
    COMMANDED_COLUMNS,
    DISTANCE_COLUMN,
    POSITION_COLUMNS,
    approach_columns,
    link_reference_column,
    scale_columns,
)
from compd.operation_settings import Wiring
from compd.simulation.truth.fixed_places import FixedPlaces
from compd.simulation.truth.indicated_tip import IndicatedTip
from compd.simulation.truth.instruments import ReferenceInstrument
from compd.simulation.truth.world import World

UM = 1e-3


@dataclass
class LoggedRows:
    """Values by column of a recording. quantities_at_zero : by column, when the log began.

    indicated_mm, reference_mm : (3,) per row, tip by the gauges and true.
    """

    columns: dict[str, list[float]] = field(default_factory=dict)
    quantities_at_zero: dict[str, float] = field(default_factory=dict)
    indicated_mm: list[FloatArray] = field(default_factory=list)
    reference_mm: list[FloatArray] = field(default_factory=list)

    def add(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.columns.setdefault(name, []).append(value)

    def error_um(self) -> float:
        """Root mean square per coordinate of true less indicated tip; for a log without reference noise."""
        error_mm = np.array(self.reference_mm) - np.array(self.indicated_mm)
        return float(np.sqrt(np.mean(error_mm**2)) / UM)


class RowLog:
    """Reads gauges and reference of a world that the campaign moves. It begins while the world is at machine zero."""

    def __init__(
        self,
        world: World,
        wiring: Wiring,
        rng: np.random.Generator,
        reference: ReferenceInstrument,
        places: FixedPlaces | None = None,
    ) -> None:
        """reference : with an exact one (sigma_um 0) the indicated tip is logged as well.

        places : of the balls or pins at which a ballbar, a probe or a nest measures.
        """
        self._places = places
        self._has_scales = bool(wiring.scale)
        self._world, self._rng = world, rng
        self._reference = reference
        self._indicated = IndicatedTip(world.mechanism, wiring) if reference.sigma_um == 0 else None
        # machine zero averages for a second, which removes nearly all noise of a thermometer
        self.rows = LoggedRows(quantities_at_zero=world.quantities())
        self._scale_columns = scale_columns(world.mechanism.scales)
        self._approach_columns = approach_columns(world.mechanism.scales * self._has_scales)
        displacements = [name for kind in ("joint_", "frame_") for name in world.names if name.startswith(kind)]
        self._displacement_columns = {name: f"{name}_um" for name in displacements}
        others = ("temperature_", "pressure_", "humidity_", "force_")
        self._others = [name for name in world.names if name.startswith(others)]

    def add(self, session: int, visit: int, point: int | None, direction: FloatArray, measured: bool = True) -> None:
        """Add a row. direction : (n,) of each link's last motion. measured : whether the reference measures, too."""
        world = self._world
        readings = {name: world.sense(name) for name in world.names}
        scales = {column: readings[f"scale_{i}"] for i, column in enumerate(self._scale_columns, 1)}
        self.rows.add(
            {
                "time_s": round(world.time_s, 6),
                "session": session,
                "point": np.nan if point is None else point,
                "visit": visit,
                **(scales if self._has_scales else self._told(np.array(list(scales.values())))),
                **{column: readings[name] / UM for name, column in self._displacement_columns.items()},
                **{name: round(readings[name], 3) for name in self._others},
                **dict(zip(self._approach_columns, direction, strict=False)),
                **(self._reference_values(point) if measured else dict.fromkeys(self._reference_columns(), np.nan)),
            }
        )
        if self._indicated is not None:
            self.rows.indicated_mm.append(self._indicated.solve(readings, world.posture))
            self.rows.reference_mm.append(world.reference_tip_mm())

    def _told(self, scale_mm: FloatArray) -> dict[str, float]:
        """The pose that the controller of a machine without scales was told, by column."""
        mechanism = self._world.mechanism
        tip_mm, turn_rad = mechanism.told_pose(scale_mm, self._world.posture)
        told = {name: round(value, 6) for name, value in zip(COMMANDED_COLUMNS, tip_mm.tolist(), strict=True)}
        if mechanism.fixed[3:].any():
            told |= {n: round(value, 9) for n, value in zip(COMMANDED_ATTITUDE_COLUMNS, turn_rad.tolist(), strict=True)}
        return told

    def _reference_columns(self) -> list[str]:
        """Names of the reference's columns."""
        kind = self._reference.kind
        if kind == "ball_plate":
            return ["ball"]
        if kind == "interferometer":
            return [link_reference_column(i) for i in range(1, self._world.mechanism.links + 1)]
        if kind == "pose":
            return [*POSITION_COLUMNS, *ATTITUDE_COLUMNS]
        return {"pin": ["pin"], "ball": ["ball"], "ballbar": ["ball", DISTANCE_COLUMN]}.get(kind, [*POSITION_COLUMNS])

    def _reference_values(self, point: int | None) -> dict[str, float]:
        """One noisy measurement by column."""
        if self._reference.kind == "ball_plate":
            return {"ball": np.nan if point is None else point}
        if self._places is not None and point is not None:
            return self._from_fixed_place(self._places, point)
        interferometer = self._reference.kind == "interferometer"
        true_mm = self._world.link_change_mm() if interferometer else self._world.reference_tip_mm()
        measured = self._reference.measure(true_mm, self._rng).tolist()
        digits = [6] * len(measured)
        if self._reference.kind == "pose":
            measured += self._reference.measure_attitude(self._world.rotation_M_P(), self._rng).tolist()
            digits += [9] * 3
        return {
            name: round(value, places)
            for name, value, places in zip(self._reference_columns(), measured, digits, strict=True)
        }

    def _from_fixed_place(self, places: FixedPlaces, point: int) -> dict[str, float]:
        """The fixed end at which a point is measured, and the length of a ballbar there."""
        end = float(places.end_of_point[point - 1] + 1)
        if self._reference.kind != "ballbar":
            return {self._reference.kind: end}
        away_mm = self._world.reference_tip_mm() - places.end_M[places.end_of_point[point - 1]]
        true_mm = np.linalg.norm(away_mm) - places.length_error_mm
        length_mm = float(self._reference.measure(np.array([true_mm]), self._rng)[0])
        return {"ball": end, DISTANCE_COLUMN: round(length_mm, 6)}
