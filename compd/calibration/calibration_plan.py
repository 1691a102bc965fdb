"""Which poses to measure for a calibration: reachable, away from singularities, and most telling together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.calibration.held_out import FEWEST_ROWS, PARTS
from compd.calibration.jacobian import pose_columns, rigid_columns, without
from compd.calibration.parameters import calibration_parameters
from compd.calibration.pose_candidates import (
    Box,
    PoseCandidates,
    candidate_poses,
    even_poses,
    reachable,
    reachable_box,
)
from compd.calibration.pose_design import Information, Observability, exchange, observability, told_directions
from compd.errors import CompdError
from compd.model import MachineModel
from compd.model.effects import Observations
from compd.plan_file import TURN_COLUMNS, plan_row, write_text_file
from compd.planning import DWELL_S, PlanFormat, rows_text
from compd.units import UM_PER_MM

# What the instrument measures at each pose.
Measured = Literal["position", "pose"]
# Candidates of the exchange: dense enough that twice as many change the tip's standard error by 1 to 3 %.
CANDIDATES = 512
# Other poses, at which the tip's standard error is computed.
_JUDGED, _JUDGED_SEED = 256, 1


class Noise(NamedTuple):
    """Standard deviations of the instrument: um of a coordinate; urad of an attitude, nan of a position."""

    um: float
    urad: float = float("nan")


@dataclass(frozen=True)
class CalibrationPlan:
    """Poses to measure for a calibration."""

    rows: tuple[dict[str, Any], ...]  #: each column of the plan's file and its value, in the order of a short way
    measured: Measured  #: what the instrument is to measure at each: ``"position"`` or ``"pose"``
    observability: Observability  #: of these poses and of those that were measured before
    #: standard error of the tip after the calibration, rms over the workspace, in space, after a rigid motion of the
    #: whole machine, which an instrument's frame cannot tell. By the tolerance alone `tip_prior_um`.
    tip_std_um: float
    tip_prior_um: float  #: the same before any pose
    numbers: int  #: numbers of the drawing

    @property
    def summary(self) -> str:
        """What the poses are worth, in two lines."""
        o = self.observability
        return (
            f"{len(self.rows)} poses, each with its {self.measured}: they tell {o.told} of the {o.combinations} "
            f"combinations that poses can tell of {self.numbers} numbers. Standard error of the tip over the workspace "
            f"{self.tip_std_um:.3g} um, by the tolerance {self.tip_prior_um:.3g} um.\n"
            f"Observability: O1 {o.O1:.3g}, O2 {o.O2:.3g}, O3 {o.O3:.3g}, O4 {o.O4:.3g}, O5 {o.O5:.3g}."
        )

    def text(self, format: PlanFormat = "plan", feed_mm_per_min: float | None = None, dwell_s: float = DWELL_S) -> str:
        """The text of the file that `write` writes, with the same parameters."""
        return rows_text(self.rows, format, f"calibration; {len(self.rows)} poses", (), feed_mm_per_min, dwell_s)

    def write(
        self,
        path: str | Path,
        format: PlanFormat = "plan",
        feed_mm_per_min: float | None = None,
        dwell_s: float = DWELL_S,
    ) -> None:
        """Write the poses; formats, parameters and errors are those of `MeasurementPlan.write`."""
        write_text_file(Path(path), self.text(format, feed_mm_per_min, dwell_s))


class PoseStudy:
    """A machine, what is measured of its poses, and what sets of poses are worth.

    parameters : the numbers of the drawing.

    Example::

        study = PoseStudy(model, "position", Noise(5.0))
        chosen = study.planned(20)
        study.tip_std_um(chosen)
    """

    def __init__(
        self,
        model: MachineModel,
        measured: Measured,
        noise: Noise,
        stroke_mm: tuple[float, float] | None = None,
        box: Box | None = None,
        before: Observations | None = None,
    ) -> None:
        """stroke_mm : shortest and longest length of an extending link.  box : None for what the machine reaches.
        before : poses that were measured already, in the same frame of the instrument."""
        self.model, self.stroke_mm = model, stroke_mm
        self.box = reachable_box(model, stroke_mm) if box is None else box
        self._measured, self._noise = measured, noise
        self.candidates = reachable(model, candidate_poses(model, self.box, CANDIDATES), stroke_mm)
        self.parameters = calibration_parameters(model, self.candidates.rows)
        judged = reachable(model, even_poses(model, self.box, _JUDGED, _JUDGED_SEED), stroke_mm).rows
        zero_M_mm = model.zero.contact.tip_M_mm
        moved = pose_columns(model, judged, self.parameters)[:, :3]
        self._judged = without(
            moved.reshape(-1, moved.shape[2]), rigid_columns(judged.tip_M_mm, zero_M_mm).reshape(-1, 6)
        ).reshape(moved.shape)
        self._before = None if before is None else self.information(before)
        everything = self.information(self.candidates.rows)
        self._everything = everything
        self._told = told_directions(_projected([everything]))

    def information(self, rows: Observations) -> Information:
        """What poses tell, over the noise."""
        columns = pose_columns(self.model, rows, self.parameters)
        tip = (
            np.concatenate([columns[:, :3], rigid_columns(rows.tip_M_mm, self.model.zero.contact.tip_M_mm)], axis=2)
            * UM_PER_MM
            / self._noise.um
        )
        if self._measured == "position":
            return Information(*np.split(tip, [columns.shape[2]], axis=2))
        # the instrument's frame turns all attitudes about {M}, the target's unknown attitude all about {P}
        turned = np.concatenate([np.zeros((len(rows), 3, 3)), np.broadcast_to(np.eye(3), (len(rows), 3, 3))], axis=2)
        attitude = np.concatenate([columns[:, 3:], turned, rows.rotation_M_P], axis=2) * 1e6 / self._noise.urad
        tip = np.concatenate([tip, np.zeros((len(rows), 3, 3))], axis=2)
        return Information(*np.split(np.concatenate([tip, attitude], axis=1), [columns.shape[2]], axis=2))

    def planned(self, count: int) -> PoseCandidates:
        """The most telling candidates, in the order of a short way from machine zero."""
        chosen = exchange(self._everything, count, self._before)
        return self.candidates.select(_short_way(self.candidates, chosen, self.model.zero.contact.tip_M_mm))

    def plan(self, count: int) -> CalibrationPlan:
        """The same as a plan.

        Raises CompdError where a calibration needs more poses than these and those measured before.
        """
        before = 0 if self._before is None else len(self._before.machine)
        if count + before < FEWEST_ROWS:
            raise CompdError.of(
                "plan",
                "has fewer poses than a calibration needs",
                value=f"{count} poses" + (f" and {before} measured" if before else ""),
                allowed=f"{FEWEST_ROWS} or more in all: of {PARTS} parts each is predicted from the others",
                next_step="plan more poses, or give the recording of those measured already: "
                "`compd plan RECORDING --calibrate N`",
            )
        poses = self.planned(count)
        return CalibrationPlan(
            rows=tuple(
                _row(poses, k, bool(self.model.attitude_is_free), self.model.scales) for k in range(len(poses.turn_rad))
            ),
            measured=self._measured,
            observability=self.observability(poses),
            tip_std_um=self.tip_std_um(poses),
            tip_prior_um=self._tip_um(np.eye(len(self.parameters.names))),
            numbers=len(self.parameters.names),
        )

    def tip_std_um(self, poses: PoseCandidates) -> float:
        """See `CalibrationPlan.tip_std_um`."""
        J = _projected(self._with(poses))
        return self._tip_um(np.asarray(np.linalg.inv(np.eye(J.shape[1]) + J.T @ J)))

    def observability(self, poses: PoseCandidates) -> Observability:
        """Of these poses with those measured before."""
        parts = self._with(poses)
        return observability(_projected(parts), self._told, sum(len(part.machine) for part in parts))

    def _with(self, poses: PoseCandidates) -> list[Information]:
        return [*([] if self._before is None else [self._before]), self.information(poses.rows)]

    def _tip_um(self, C: FloatArray) -> float:
        variance_mm2 = np.einsum("nip,pq,niq->n", self._judged, C, self._judged)
        return float(np.sqrt(variance_mm2.mean()) * UM_PER_MM)


def _projected(parts: Sequence[Information]) -> FloatArray:
    """(n m, P) of poses that share one registration, which is projected out."""
    A = np.concatenate([part.machine.reshape(-1, part.machine.shape[2]) for part in parts])
    return without(A, np.concatenate([part.registration.reshape(-1, part.registration.shape[2]) for part in parts]))


def _short_way(candidates: PoseCandidates, chosen: IntArray, start_M_mm: FloatArray) -> IntArray:
    """The chosen ones, each the nearest to the one before."""
    left, way, here = chosen.tolist(), [], start_M_mm
    while left:
        distances = np.linalg.norm(candidates.tip_M_mm[left] - here, axis=1)
        way.append(left.pop(int(np.argmin(distances))))
        here = candidates.tip_M_mm[way[-1]]
    return np.array(way, dtype=np.int64)


def _row(poses: PoseCandidates, k: int, turned: bool, scales: int) -> dict[str, Any]:
    turns = dict(zip(TURN_COLUMNS, poses.turn_rad[k].tolist(), strict=True)) if turned else {}
    row = plan_row("calibration, at rest", 0.0, poses.tip_M_mm[k].tolist(), {}, [0.0] * scales, 0.0, turns)
    return {"row": k + 1, **row}
