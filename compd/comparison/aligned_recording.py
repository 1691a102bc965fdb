"""A recording aligned with its machine: the measured coordinates beside the model's prediction from the gauges."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.display_unit import in_place_unit
from compd.comparison.external_machine import external_change, external_observations, external_prediction
from compd.comparison.registration import Registration, displacement_columns, register, registration_columns
from compd.comparison.velocity import velocities
from compd.configuration import Configuration
from compd.errors import CompdError, Problem, RecordingError
from compd.machine_builder import build_model
from compd.model.deltas import Deltas, deltas_by_effect, split_by_port, sum_deltas
from compd.model.effect import ConstantValues, Effect, FittedEffect, Port
from compd.model.effect_needs import unmet_needs
from compd.model.kernels.rotation import compose, rotation_matrix, rotation_vector
from compd.model.machine import MachineModel
from compd.model.motion import Movement
from compd.model.observations import Observations
from compd.model.observe import observe
from compd.model.prediction import predict
from compd.model.sensitivity import Sensitivity, sensitivities
from compd.model.solve_status import MEANING, Reason
from compd.recording.gaps import filled
from compd.recording.recording import Recording, UsableRows
from compd.tables import Columns, data_frame, html_table
from compd.units import REFERENCE_UNITS

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class AlignedRecording:
    """A recording with its machine: N rows with m measured coordinates each, x, y, z of the tip or lengths of links.

    Attributes
    ----------
    recording : Recording
        The columns of the file by name, and what the sidecar says.
    model : MachineModel or None
        Kinematics and frame of the machine; None for ``machine: external``.
    rows : Observations
        What effects are computed from, for all N rows, also those that are not used: effects with memory need their
        history.
    labels : tuple of str
        The m coordinates: ``"x"``, ``"y"``, ``"z"``, or ``"link 1"`` ...
    axes : tuple of int
        The same as numbers: 0, 1, 2 for x, y, z; or the links, from 0.
    measured_mm : (N, m) array
        The reference in {M}, or changes of link lengths, mm; nan where nothing was measured.
    registration : Registration or None
        How `measured_mm` came from the instrument's frame into {M}; None where it was measured there.
    geometry_hash : str
        Of the configuration that the model was built from; ``""`` for ``machine: external``.
    """

    recording: Recording
    model: MachineModel | None
    rows: Observations
    labels: tuple[str, ...]
    axes: tuple[int, ...]
    measured_mm: FloatArray
    registration: Registration | None
    geometry_hash: str = ""
    _by_port: dict[Port, Sensitivity] = field(default_factory=dict, repr=False)

    @property
    def unit(self) -> str:
        """The unit in which people read the residual: ``"um"``, or what the sidecar names, such as ``"arcsec"``."""
        return self.recording.unit

    @property
    def of_links(self) -> bool:
        """Whether link lengths were measured, not the tip."""
        return self.recording.reference_link_mm is not None

    @property
    def registered(self) -> bool:
        """Whether the parameters of the instrument's frame are always fitted along."""
        reference = self.recording.reference
        return reference is not None and reference.frame == "instrument" and not self.of_links

    def predicted_mm(self, added: Deltas, rows: Observations | None = None) -> FloatArray:
        """(N, m) prediction of the reference when effects add `added` at their ports; nan where there is no pose.

        rows : other observations than the recording's own, None for those.
        """
        rows = self.rows if rows is None else rows
        if self.model is None:
            predicted = external_prediction(self.recording)
            return predicted + external_change(added, self.axes, self.of_links) if added else predicted
        prediction = predict(self.model, rows, added)
        if self.of_links:
            return (prediction.link_length_mm - self.model.zero.link_length_mm)[:, list(self.axes)]
        return prediction.tip_mm[:, list(self.axes)]

    def sensitivity(self, ports: Collection[Port]) -> Mapping[Port, Sensitivity]:
        """Derivatives of the prediction by what is added at `ports`; each is computed once."""
        new = [port for port in ports if port not in self._by_port]
        if new and self.model is not None:
            self._by_port.update(sensitivities(self.model, self.rows, new))
        return self._by_port

    def columns(self, effect: Effect, shape: ConstantValues) -> FloatArray:
        """(N, m, P) derivatives of the prediction (mm) by each parameter of the effect."""
        basis, _ = effect.basis(self.rows, shape, None)
        return self.propagated(effect, basis)

    def propagated(self, effect: Effect, basis: FloatArray) -> FloatArray:
        """(N, m, P) changes of the prediction (mm) by what is added at the effect's ports (N, sum of sizes, P), mm."""
        added = split_by_port(effect, self.rows, basis)
        if self.model is None:
            return external_change(added, self.axes, self.of_links)
        by_port = self.sensitivity(effect.ports)
        changes = [
            (by_port[port].link_length if self.of_links else by_port[port].tip)[:, list(self.axes)] @ values
            for port, values in added.items()
        ]
        return np.asarray(sum(changes[1:], start=changes[0]))

    @cached_property
    def registration_columns(self) -> FloatArray:
        """(N, m, Q) derivatives (mm) of what is always fitted along; none of a machine's own frame, Q = 0.

        Of an instrument's frame its small motion; of an external model a constant of each coordinate, because where
        its zero lies says nothing about the machine.
        """
        if self.registered:
            return registration_columns(self.rows.tip_M_mm, self.axes)
        if self.model is None:
            return displacement_columns(*self.measured_mm.shape)
        return np.zeros((*self.measured_mm.shape, 0))

    @cached_property
    def gaps_filled(self) -> AlignedRecording:
        """The same recording, single empty cells of its quantities filled from the nearest row in time.

        For what describes a residual; what the effects of a model compute is never made of filled values.
        """
        quantities = {name: filled(values, self.rows.time_s) for name, values in self.rows.quantities.items()}
        if all(values is self.rows.quantities[name] for name, values in quantities.items()):
            return self
        return replace(self, rows=replace(self.rows, quantities=quantities))

    @cached_property
    def usable(self) -> UsableRows:
        """Rows with every gauge and reference value and a pose; why the others are left out."""
        recording = self.recording
        # a link's length needs neither the frame nor the other links' references
        needed = [*recording.gauge_columns, *recording.reference_columns, *recording.model_columns]
        mask, left, reason = recording.usable(needed)
        left_out = {**recording.left_out, **left}
        nowhere = mask & ~np.isfinite(self.predicted_mm({})).all(axis=1)
        if nowhere.any():
            why = self._why_no_pose(nowhere)
            left_out[why] = int(nowhere.sum())
            reason[nowhere] = why
        return UsableRows(mask & ~nowhere, left_out, reason)

    def to_dataframe(self) -> pd.DataFrame:
        """The rows, as a pandas data frame.

        Returns
        -------
        pandas.DataFrame
            N rows: `row`, the row as a spreadsheet shows it; every column of the file under its own name, in its own
            unit; then for each measured coordinate `measured_x_mm` and `predicted_x_mm` in {M} (or
            `measured_link_1_mm`, changes of length), predicted from the gauges without any effect; for a reference in
            another unit `measured_x_arcsec` ... nan where a cell is empty and where there is no pose.

        Raises
        ------
        CompdError
            Where pandas is not installed.
        """
        measured, predicted = (in_place_unit(place, self.unit) for place in (self.measured_mm, self.predicted_mm({})))
        ending = REFERENCE_UNITS[self.unit]
        columns: dict[str, Any] = {"row": self.recording.row, **self.recording.columns}
        for k, name in enumerate(self.label_names):
            columns[f"measured_{name}_{ending}"] = measured[:, k]
            columns[f"predicted_{name}_{ending}"] = predicted[:, k]
        return data_frame(columns)

    @property
    def label_names(self) -> tuple[str, ...]:
        """The m measured coordinates as parts of column names, such as "x" and "link_1"."""
        return tuple(label.replace(" ", "_") for label in self.labels)

    def _repr_html_(self) -> str:
        columns = {name: values for name, values in self.recording.columns.items() if np.isfinite(values).any()}
        table: Columns = {
            "column": list(columns),
            "values": [int(np.isfinite(values).sum()) for values in columns.values()],
            "smallest": [float(np.nanmin(values)) for values in columns.values()],
            "largest": [float(np.nanmax(values)) for values in columns.values()],
        }
        return html_table(
            str(self), table, [f"{count} rows left out: {why}" for why, count in self.usable.left_out.items()]
        )

    def __str__(self) -> str:
        recording = self.recording
        hours = (recording.time_s[-1] - recording.time_s[0]) / 3600.0
        when = f"over {hours:.3g} h" if recording.has_time else "in order, without time"
        return (
            f"{recording.path.name}: {recording.machine}, {recording.rows} rows {when}, "
            f"{int(self.usable.mask.sum())} of them with a prediction and a measured {', '.join(self.labels)}"
        )

    def __repr__(self) -> str:
        return f"<AlignedRecording {self}>"

    def attitude_residual_urad(self, added: Deltas) -> FloatArray | None:
        """(N, 3) rotation vector from the modelled to the measured attitude, in {M}; None where none was measured."""
        measured = self.recording.reference_rotation_rad
        if measured is None or self.model is None:
            return None
        attitude = rotation_matrix(measured)
        if self.registration is not None:
            attitude = compose(self.registration.rotation, attitude)
        modelled = predict(self.model, self.rows, added).rotation_M_P
        return np.asarray(rotation_vector(compose(attitude, modelled.transpose(0, 2, 1)))) * 1e6

    def _why_no_pose(self, rows: BoolArray) -> str:
        if self.model is None:
            return "the model's prediction is empty"
        reasons = predict(self.model, self.rows, {}).reason[rows]
        return "no pose: " + "; ".join(MEANING[Reason(int(code))] for code in np.unique(reasons[reasons > 0]))


def align_recording(
    recording: Recording,
    configuration: Configuration | None,
    criteria: ComparisonCriteria = ComparisonCriteria(),
) -> AlignedRecording:
    """A recording on the machine that the configuration describes; None only for an external model.

    Raises RecordingError where there is no reference, or where nothing can be computed from any row.
    """
    where = str(recording.path)
    if recording.reference is None:
        raise RecordingError(Problem(where=where, what="names no reference", next_step="add one with `compd join`"))
    starts = _session_starts(recording)
    if configuration is None:
        model, geometry_hash = None, ""
        observations = external_observations(recording, starts)
    else:
        model = build_model(configuration.geometry, configuration.wiring)
        geometry_hash = configuration.geometry_hash
        observations = _observations(recording, model, starts)
    if recording.reference_link_mm is not None:
        labels = tuple(f"link {i}" for i in recording.reference_links)
        links = tuple(i - 1 for i in recording.reference_links)
        return AlignedRecording(
            recording, model, observations, labels, links, recording.reference_link_mm, None, geometry_hash
        )
    measured_mm = recording.reference_mm
    if measured_mm is None:
        raise RecordingError(Problem(where=where, what="has no column of the reference"))
    axes = tuple("xyz".index(axis) for axis in recording.reference_axes)
    registration = None
    if recording.reference.frame == "instrument":
        registration, measured_mm = _registered(recording, measured_mm, observations.tip_M_mm, axes, criteria)
    return AlignedRecording(
        recording, model, observations, recording.reference_axes, axes, measured_mm, registration, geometry_hash
    )


def _registered(
    recording: Recording,
    measured_mm: FloatArray,
    tip_M_mm: FloatArray,
    axes: tuple[int, ...],
    criteria: ComparisonCriteria,
) -> tuple[Registration | None, FloatArray]:
    """How the instrument's frame lies in {M}, and what was measured (N, m), in {M}; None where nothing fixes it.

    Points in the plane z = 0 are turned in it. Along fewer axes, or of a point of which the third coordinate matters,
    no frame can be laid over another: it must lie near already.
    """
    in_plane = axes == (0, 1) and not np.isfinite(tip_M_mm[:, 2]).any()
    if len(axes) < 3 and not in_plane:
        return None, measured_mm
    points, predicted = np.zeros((len(measured_mm), 3)), np.zeros((len(measured_mm), 3))
    points[:, list(axes)], predicted[:, list(axes)] = measured_mm, tip_M_mm[:, list(axes)]
    registration = register(np.where(recording.excluded[:, None], np.nan, points), predicted, criteria)
    if registration is not None:
        measured_mm = registration.into_M(points)[:, list(axes)]
    return registration, measured_mm


def effect_deltas(fitted: Sequence[FittedEffect], rows: Observations) -> tuple[dict[str, Deltas], Deltas]:
    """What each effect adds at its ports, by the effect's id; and the sum over all effects.

    Raises CompdError with everything that the effects need and the recording has not.
    """
    problems = [problem for effect in fitted for problem in unmet_needs(effect.effect, rows.available, rows.links)]
    if problems:
        raise CompdError(problems)
    by_effect, _ = deltas_by_effect(fitted, rows, {})
    return by_effect, sum_deltas(list(by_effect.values()))


def _observations(recording: Recording, model: MachineModel, starts: BoolArray) -> Observations:
    """Every row of the recording, as effects take it; comparators that were not recorded count as unmoved.

    starts : (N,) rows without a history.
    """
    assert model.constants is not None
    count = recording.rows
    scale_mm = recording.scale_mm
    if scale_mm is None:
        raise RecordingError(
            Problem(
                where=str(recording.path),
                what="has no scale columns",
                allowed="scale_1_mm ...",
                next_step="a machine's recording needs its scales; `machine: external` needs none",
            )
        )
    comparators = model.joint_weights.shape[1]
    joint_mm = np.zeros((count, comparators)) if recording.joint_mm is None else recording.joint_mm
    frame_mm = np.zeros((count, 9)) if recording.frame_mm is None else recording.frame_mm
    approach = np.zeros_like(scale_mm) if recording.approach is None else np.nan_to_num(recording.approach)
    at_point = np.zeros(count, dtype=bool) if recording.point is None else recording.point >= 0
    velocity = velocities(recording.time_s, starts, at_point, scale_mm, joint_mm)
    movement = Movement(approach, *np.split(velocity, [scale_mm.shape[1]], axis=1))
    return observe(
        model,
        model.constants,
        scale_mm=scale_mm,
        joint_mm=joint_mm,
        frame_mm=frame_mm,
        quantities=recording.quantities,
        time_s=recording.time_s,
        session_start=starts,
        movement=movement,
    )


def _session_starts(recording: Recording) -> BoolArray:
    """(N,) rows without a history: the first of each session."""
    starts = np.zeros(recording.rows, dtype=bool)
    starts[:1] = True
    if recording.session is not None:
        starts[1:] = recording.session[1:] != recording.session[:-1]
    return starts
