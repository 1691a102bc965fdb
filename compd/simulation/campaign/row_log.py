"""What is written down in a campaign: the gauges' readings and the reference's, row by row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from compd.arrays import FloatArray
from compd.configuration.operation import Wiring
from compd.recording.columns import POSITION_COLUMNS, approach_columns, link_reference_column, scale_columns
from compd.simulation.truth.apparent import Apparent
from compd.simulation.truth.instruments import Kind, noisy
from compd.simulation.truth.world import World

UM = 1e-3


@dataclass
class LoggedRows:
    """What was written down, by column of a recording; `apparent_mm`: where the gauges take the tip to be."""

    columns: dict[str, list[float]] = field(default_factory=dict)
    apparent_mm: list[FloatArray] = field(default_factory=list)
    reference_mm: list[FloatArray] = field(default_factory=list)

    def add(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            self.columns.setdefault(name, []).append(value)

    def error_um(self) -> float:
        """Root mean square per coordinate of what the reference shows beyond the gauges."""
        wrong = np.array(self.reference_mm) - np.array(self.apparent_mm)
        return float(np.sqrt(np.mean(wrong**2)) / UM)


class RowLog:
    """Looks at a machine that somebody else moves."""

    def __init__(
        self,
        world: World,
        wiring: Wiring,
        rng: np.random.Generator,
        reference: Kind,
        sigma_um: float,
        outlier_share: float,
    ) -> None:
        """`sigma_um`: of the reference, 0 for the truth itself; then it is also noted what the gauges make of it."""
        self._world, self._rng = world, rng
        self._reference, self._sigma_um, self._outlier_share = reference, sigma_um, outlier_share
        self._apparent = Apparent(world.mechanism, wiring) if sigma_um == 0 else None
        self.rows = LoggedRows()

    def add(self, session: int, visit: int, point: int | None, direction: FloatArray, measured: bool = True) -> None:
        """A row. direction : (n,) in which each link moved last. Not measured: the gauges alone are read."""
        world = self._world
        shown = {name: world.sense(name) for name in world.names}
        links = world.mechanism.links
        joints = [name for name in shown if name.startswith("joint_")]
        frames = [name for name in shown if name.startswith("frame_")]
        others = [name for name in shown if name.startswith(("temperature_", "pressure_", "humidity_", "force_"))]
        self.rows.add(
            {
                "time_s": round(world.time_s, 6),
                "session": session,
                "point": np.nan if point is None else point,
                "visit": visit,
                **{column: shown[f"scale_{i}"] for i, column in enumerate(scale_columns(links), 1)},
                **{f"{name}_um": shown[name] / UM for name in (*joints, *frames)},
                **{name: round(shown[name], 3) for name in others},
                **dict(zip(approach_columns(links), direction, strict=True)),
                **(self._measured(point) if measured else dict.fromkeys(self._names(), np.nan)),
            }
        )
        if self._apparent is not None:
            self.rows.apparent_mm.append(self._apparent.tip(shown, world.posture))
            self.rows.reference_mm.append(world.shown_mm())

    def _names(self) -> list[str]:
        """The reference's columns."""
        if self._reference == "ball_plate":
            return ["ball"]
        if self._reference == "interferometer":
            return [link_reference_column(i) for i in range(1, self._world.mechanism.links + 1)]
        return list(POSITION_COLUMNS)

    def _measured(self, point: int | None) -> dict[str, float]:
        if self._reference == "ball_plate":
            return {"ball": np.nan if point is None else point}
        if self._reference == "interferometer":
            changes = noisy(self._world.link_change_mm(), self._sigma_um, self._rng, self._outlier_share)
            return {name: round(value, 6) for name, value in zip(self._names(), changes.tolist(), strict=True)}
        tip = noisy(self._world.shown_mm(), self._sigma_um, self._rng, self._outlier_share)
        return {name: round(value, 6) for name, value in zip(self._names(), tip.tolist(), strict=True)}
