"""A machine whose pose own kinematics or a client gives, as the live loop sees it: the model's effects on that pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np

from compd.arrays import FloatArray
from compd.model import EffectMemory, MachineModel, observe_external
from compd.model.effects import (
    AtZero,
    Effect,
    EffectProgram,
    FittedEffect,
    Observations,
    Port,
    build_program,
    needed_quantities,
)
from compd.model.external.own_kinematics import Kinematics, OwnKinematicsError, OwnPose, own_columns, own_pose
from compd.model.kinematics import Actuators, Contact, FrameGeometry, Motion, Movement, ToolOnPlatform, track_motion
from compd.rotation import compose, rotation_matrix, rotation_vector

# The least number of links that can move a tip along three axes and turn it.
_LINKS_THAT_TURN = 4


@dataclass(frozen=True, eq=False)
class ExternalModel(MachineModel):
    """The model of such a machine. Build it with `new_external_model`.

    Its scales since machine zero are its links; it has no joints and no frame of which anything is known. What effects
    add at `reference` is added to the pose, what they add at `scale` and `link` is carried there by the derivatives.

    own : the class that gives the pose; None where clients give it.  given : the pose that a client has given for this
    snapshot.
    """

    own: Kinematics | None = None
    given: OwnPose | None = None
    link_count: int = 0

    @property
    def links(self) -> int:
        """Number of scales."""
        return self.link_count

    @property
    def scales(self) -> int:
        """Number of scales."""
        return self.link_count

    @cached_property
    def live_effects(self) -> tuple[FittedEffect, ...]:
        """All effects but those of the library at the reference, which are the reference instrument's."""
        return tuple(fitted for fitted in self.effects if acts_on_machine(fitted.effect))

    @cached_property
    def live_covariance(self) -> FloatArray:
        """(P, P) of the fitted numbers of `live_effects`; nan where the model does not give it."""
        live = [acts_on_machine(fitted.effect) for fitted in self.effects for _ in fitted.theta]
        if not len(self.covariance):
            return np.full((sum(live),) * 2, np.nan)
        return self.covariance[np.ix_(live, live)]

    @cached_property
    def program(self) -> EffectProgram:
        """No effect is computed by the kernel: names of the quantities that are needed now. At machine zero none is:
        effects count as they are written."""
        nothing = build_program((), None, self.links, 0, 0)
        needed = {f.effect.id: needed_quantities(f.effect, self.links) for f in self.live_effects}
        names = tuple(dict.fromkeys(name for each in needed.values() for name in each))
        return nothing._replace(quantities=names, references=())

    @property
    def settings(self) -> tuple[str, ...]:
        """Names of the quantities that the own kinematics needs."""
        return () if self.own is None else tuple(self.own.settings)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of what effects may read that the own kinematics gives."""
        return () if self.own is None else tuple(self.own.gives)

    def with_pose(self, given: OwnPose) -> Self:
        """The same machine at a pose that a client has given."""
        return replace(self, given=given)

    def without_effects(self) -> Self:
        """The same machine, of which nothing is corrected."""
        return replace(self, effects=(), covariance=np.zeros((0, 0)))


def acts_on_machine(effect: Effect) -> bool:
    """Whether an effect is one of the machine itself: what the library has at the reference is the instrument's."""
    return effect.live or bool(effect.declared)


def new_external_model(own: Kinematics | None, links: int, scale_signal_period_mm: float = np.nan) -> ExternalModel:
    """A machine with so many scales. own : None where clients give the pose."""
    nowhere, no_points, unknown = np.zeros(3), np.zeros((0, 3)), np.full(3, np.nan)
    frame = FrameGeometry(
        np.full((3, 3), np.nan), no_points, np.zeros(0, dtype=np.int64), np.zeros((3, 3)), nowhere, np.eye(3)
    )
    none, lengths = np.zeros(0, dtype=np.int64), np.full(links, np.nan)
    zero = AtZero(no_points, nowhere, np.eye(3), Contact(nowhere, nowhere), lengths, lengths, np.full(9, np.nan))
    constants = _no_rows().constants._replace(scale_signal_period_mm=scale_signal_period_mm)
    return ExternalModel(
        frame=frame,
        platform_joints_P_mm=no_points,
        revolute_axes_P=no_points,
        hinges=np.zeros((0, 2), dtype=np.int64),
        actuators=Actuators(none, no_points, no_points, np.zeros(0), none, np.zeros(0), np.zeros(6, dtype=np.int64)),
        arrangement=ToolOnPlatform(unknown),
        joint_weights=np.zeros((links, 0)),
        weight_N=np.nan,
        weight_at_P_mm=unknown,
        zero=zero,
        constants=constants,
        own=own,
        link_count=links,
    )


def _no_rows() -> Observations:
    nothing = np.zeros((0, 0))
    return observe_external(
        np.zeros((0, 3)),
        scale_mm=nothing,
        movement=Movement(nothing, nothing, nothing),
        quantities={},
        time_s=np.zeros(0),
        session_start=np.zeros(0, dtype=bool),
        recorded=frozenset(),
    )


class ExternalRows(NamedTuple):
    """N rows with their poses: rows as effects take them, poses (N), and the motion after the last row."""

    rows: Observations
    poses: tuple[OwnPose, ...]
    motion: Motion | None


def external_rows(
    model: ExternalModel,
    scale_mm: FloatArray,
    quantities: Mapping[str, FloatArray],
    time_s: FloatArray,
    quantities_at_zero: Mapping[str, float] | None,
    memory: EffectMemory,
    given: Sequence[OwnPose] | None = None,
) -> ExternalRows:
    """Rows that follow each other in time.

    scale_mm : (N, n) since machine zero.  quantities : (N,) each, those of the settings and of the effects.
    given : the pose of each row; None where the model has it.
    Raises OwnKinematicsError where the own kinematics gives no pose, and none was given.
    """
    poses: list[OwnPose] = []
    columns: dict[str, list[FloatArray]] = {name: [] for name in model.columns}
    for row, scales in enumerate(scale_mm):
        settings = {name: float(quantities[name][row]) for name in model.settings}
        poses.append(_pose(model, scales, settings) if given is None else given[row])
        if model.own is not None:
            for name, value in own_columns(model.own, scales, settings).items():
                columns[name].append(value)
    time_s = np.asarray(time_s, dtype=np.float64)
    no_joints = np.zeros((len(scale_mm), 0))
    movement, motion = Movement.unknown(scale_mm, no_joints), None
    if model.needs_motion:
        movement, motion = track_motion(memory.motion, time_s, scale_mm, no_joints)
    session_start = np.zeros(len(scale_mm), dtype=bool)
    session_start[:1] = memory.is_empty
    rows = observe_external(
        np.array([pose.tip_M_mm for pose in poses]).reshape(-1, 3),
        scale_mm=scale_mm,
        movement=movement,
        quantities={**quantities, **{name: np.array(values) for name, values in columns.items()}},
        time_s=time_s,
        session_start=session_start,
        recorded=frozenset(known_live(model.links)),
    )
    assert model.constants is not None, "it was made with its constants"
    rows = replace(rows, constants=model.constants, quantities_at_zero=quantities_at_zero)
    return ExternalRows(rows, tuple(poses), motion)


def known_live(links: int) -> set[str]:
    """What effects may need that a running machine with so many scales gives."""
    return {"time", "order"} | ({"scale", "direction", "motion"} if links else set())


def _pose(model: ExternalModel, scale_mm: FloatArray, settings: Mapping[str, float]) -> OwnPose:
    if model.given is not None:
        return model.given
    if model.own is None:
        raise OwnKinematicsError.of(
            "kinematics: client",
            "no client has given the pose yet",
            next_step="send `TARGET` with the pose, and with its derivatives where the machine has scales",
        )
    return own_pose(model.own, scale_mm, settings)


def scale_change_mm(deltas: Mapping[Port, FloatArray], links: int) -> FloatArray:
    """(N, n) what effects add at `scale` and `link`."""
    any_port = next(iter(deltas.values()))
    change = np.zeros((len(any_port), links))
    for port in ("scale", "link"):
        if port in deltas:
            change = change + deltas[port]
    return change


def carried_to_pose(deltas: Mapping[Port, FloatArray], poses: Sequence[OwnPose]) -> FloatArray:
    """(N, 6) what effects add to the pose at their ports, mm and rad; the rotation is about the axes of {M}."""
    change = np.zeros((len(poses), 6))
    if "reference" in deltas:
        change = change + deltas["reference"]
    if "scale" in deltas or "link" in deltas:
        by_scale = np.array([pose.by_scale for pose in poses])
        added = scale_change_mm(deltas, by_scale.shape[2])
        change = change + (by_scale @ added[:, :, None])[:, :, 0]
    return change


def scales_for(deltas: Mapping[Port, FloatArray], pose: OwnPose) -> FloatArray:
    """(n,) by how much scales must change to bring the tip, and the rotation where they can turn it, to where it is
    without what one effect adds (1, size) at its ports; by least squares where they cannot reach it all."""
    links = pose.by_scale.shape[1]
    change = scale_change_mm(deltas, links)[0]
    if "reference" in deltas and links:
        rows = 6 if links >= _LINKS_THAT_TURN and np.isfinite(pose.by_scale).all() else 3
        change = change + np.linalg.lstsq(pose.by_scale[:rows], deltas["reference"][0, :rows], rcond=None)[0]
    scales: FloatArray = -change
    return scales


def moved_pose(pose: OwnPose, change: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The tip (3,) and the rotation vector (3,), nan where unknown, after a change (6,)."""
    rotation = pose.rotation_M_rad
    if np.isfinite(rotation).all() and change[3:].any():
        rotation = np.asarray(rotation_vector(compose(rotation_matrix(change[3:]), rotation_matrix(rotation))))
    return pose.tip_M_mm + change[:3], rotation
