"""A recording aligned with its machine: the measured coordinates beside the model's prediction from the gauges."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray, rms
from compd.columns import is_sensitivity
from compd.comparison.alignment.external_machine import external_change, external_prediction
from compd.comparison.alignment.fixed_ends import FixedEnds
from compd.comparison.alignment.measured_attitude import (
    attitude_mm,
    attitude_registration_columns,
    measured_attitude,
    target_turn,
)
from compd.comparison.alignment.registration import (
    Registration,
    displacement_columns,
    points_spread_mm,
    registration_columns,
)
from compd.comparison.alignment.target_place import HELD, PlacedTarget, target_change, target_M_mm
from compd.comparison.criteria import ComparisonCriteria
from compd.comparison.lone_visits import lone_distance
from compd.comparison.outliers import outlier_limits
from compd.display_unit import ATTITUDE_LABELS, ATTITUDE_UNIT, MM_PER_RAD, in_place_unit
from compd.errors import CompdError
from compd.model import (
    Deltas,
    MachineModel,
    Sensitivity,
    deltas_by_effect,
    predict,
    sensitivities,
    split_by_port,
    sum_deltas,
)
from compd.model.effects import ConstantValues, Effect, FittedEffect, Observations, Port, evaluate_basis, unmet_needs
from compd.model.kernels import Reason
from compd.parameter_ranges import StatedRange, on_machine
from compd.recording import Recording, UsableRows
from compd.result_tables import Columns, data_frame, html_table
from compd.statistics import MIN_SIGMA, filled, trimmed_scale
from compd.units import REFERENCE_UNITS, UM_PER_MM

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class AlignedRecording:
    """A recording with its machine: N rows with m measured coordinates each.

    These are x, y, z of the tip, with rx, ry, rz of the attitude where that was measured too; or lengths of links; or
    the distance from a fixed ball.

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
        The m coordinates: ``"x"``, ``"y"``, ``"z"``, ``"rx"`` ..., or ``"link 1"`` ..., or ``"distance"``.
    axes : tuple of int
        The axes of the tip that are measured, 0, 1, 2 for x, y, z; all three of a distance; or the links, from 0.
    measured_mm : (N, m) array
        The reference in {M}, or changes of link lengths, or distances, mm; a urad of the attitude counts as a um. nan
        where nothing was measured.
    registration : Registration or None
        How `measured_mm` came from the instrument's frame into {M}; None where it was measured there.
    ends : FixedEnds or None
        Of distances and pins the fixed balls or pins, whose places are always fitted along; None for others.
    geometry_hash : str
        Of the configuration that the model was built from; ``""`` for ``machine: external``.
    criteria : ComparisonCriteria
        The numbers by which it was aligned, and by which it is compared and fitted.
    target : PlacedTarget or None
        Where the instrument's target is on the platform; None where it is taken to be at the tip.
    held : frozenset of str
        Numbers of the registration that are not fitted along; see `HELD`.
    ranges : tuple of StatedRange
        Plausible ranges that were stated for single parameters; others are the machine's or the library's.
    """

    recording: Recording
    model: MachineModel | None
    rows: Observations
    labels: tuple[str, ...]
    axes: tuple[int, ...]
    measured_mm: FloatArray
    registration: Registration | None
    geometry_hash: str = ""
    ends: FixedEnds | None = None
    criteria: ComparisonCriteria = ComparisonCriteria()
    target: PlacedTarget | None = None
    held: frozenset[str] = frozenset()
    ranges: tuple[StatedRange, ...] = ()
    _by_port: dict[Port, Sensitivity] = field(default_factory=dict, repr=False)

    def on_machine(self, effect: Effect) -> Effect:
        """The effect with its plausible ranges on this recording's machine; see `compd.parameter_ranges`."""
        return _in_unit(on_machine(effect, self.rows, self.ranges), self.unit)

    @property
    def unit(self) -> str:
        """The unit in which people read the residual: ``"um"``, or what the sidecar names, such as ``"arcsec"``."""
        return self.recording.unit

    @property
    def of_links(self) -> bool:
        """Whether link lengths were measured, not the tip."""
        return self.recording.reference_link_mm is not None

    @property
    def of_distance(self) -> bool:
        """Whether the distance from fixed balls was measured."""
        return self.ends is not None and self.ends.of_lengths

    @property
    def with_attitude(self) -> bool:
        """Whether the attitude is among the measured coordinates, as the last three of them."""
        return self.labels[-len(ATTITUDE_LABELS) :] == ATTITUDE_LABELS

    @property
    def shows_tip(self) -> bool:
        """Whether all three coordinates of the tip are measured; they are the first three then."""
        return self.labels[:3] == ("x", "y", "z")

    @property
    def lengths(self) -> slice:
        """The measured coordinates that are in `unit`: all but those of the attitude."""
        return slice(len(self.labels) - 3 * self.with_attitude)

    def scatter_by_unit(self, residual_um: FloatArray) -> FloatArray:
        """(m,) scatter of a residual (R, m), alike for all lengths and for the three coordinates of an attitude."""
        scatter_um = trimmed_scale(residual_um)
        by_unit_um = np.full(len(scatter_um), max(rms(scatter_um[self.lengths]), MIN_SIGMA))
        if self.with_attitude:
            by_unit_um[-3:] = max(rms(scatter_um[-3:]), MIN_SIGMA)
        return by_unit_um

    def unit_of(self, label: str) -> str:
        """The unit in which people read the residual of a coordinate."""
        return ATTITUDE_UNIT if label in ATTITUDE_LABELS else self.unit

    @property
    def registered(self) -> bool:
        """Whether the parameters of the instrument's frame, or the places of fixed ends, are always fitted along."""
        reference = self.recording.reference
        return reference is not None and reference.frame == "instrument" and not self.of_links

    def predicted_mm(self, added: Deltas, rows: Observations | None = None) -> FloatArray:
        """(N, m) prediction of the reference when effects add `added` at their ports; nan where there is no pose.

        rows : other observations than the recording's own, None for those.
        """
        rows = self.rows if rows is None else rows
        if self.model is None:
            predicted = external_prediction(self.recording)
            predicted = predicted + external_change(added, self.axes, self.of_links) if added else predicted
            return self._from_ends(predicted)
        prediction = predict(self.model, rows, added)
        if self.of_links:
            return (prediction.link_length_mm - self.model.zero.link_length_mm)[:, list(self.axes)]
        seen_mm = target_M_mm(prediction.tip_mm, prediction.rotation_M_P, self.recording.target_P_mm)
        shown = self._from_ends(seen_mm[:, list(self.axes)])
        if self.with_attitude:
            return np.concatenate([shown, attitude_mm(prediction.rotation_M_P, rows.rotation_M_P)], axis=1)
        return shown

    def _from_ends(self, tip_mm: FloatArray) -> FloatArray:
        """(N, m) what is measured of the tip (N, axes): its distance from the row's fixed ball, or the tip itself."""
        return self.ends.lengths_mm(tip_mm) if self.ends is not None and self.ends.of_lengths else tip_mm

    @cached_property
    def nominal_tip_mm(self) -> FloatArray:
        """(N, 3) what is seen of the tip as predicted without effects, in the frame in which the reference shows it.

        Where reflectors were measured in its place, these.
        """
        if self.model is None:
            return self.rows.tip_M_mm
        prediction = predict(self.model, self.rows, {})
        return target_M_mm(prediction.tip_mm, prediction.rotation_M_P, self.recording.target_P_mm)

    def shown(self, sensitivity: Sensitivity) -> FloatArray:
        """(N, m, size) the measured coordinates' share of a prediction's derivatives."""
        if self.of_links:
            return sensitivity.link_length[:, list(self.axes)]
        tip, place_P_mm = sensitivity.tip, self.recording.target_P_mm
        if place_P_mm is not None:
            tip = target_change(tip, sensitivity.rotation, self.rows.rotation_M_P, place_P_mm)
        shown = self.along_ends(tip[:, list(self.axes)])
        if self.with_attitude:
            return np.concatenate([shown, sensitivity.rotation * MM_PER_RAD], axis=1)
        return shown

    def along_ends(self, change: FloatArray) -> FloatArray:
        """(N, m, size) changes of the tip (N, axes, size) along what is measured: of a distance from the fixed ball."""
        if self.ends is None or not self.ends.of_lengths:
            return change
        return np.asarray(self.ends.directions(self.nominal_tip_mm) @ change)

    def select(self, index: IntArray | slice) -> AlignedRecording:
        """The rows of this index (R,), in its order; of a slice without a copy."""
        return replace(
            self,
            recording=self.recording.select(index),
            rows=self.rows.select(index),
            measured_mm=self.measured_mm[index],
            ends=None if self.ends is None else self.ends.select(index),
            _by_port={},
        )

    def sensitivity(self, ports: Collection[Port]) -> Mapping[Port, Sensitivity]:
        """Derivatives of the prediction by what is added at `ports`; each is computed once."""
        new = [port for port in ports if port not in self._by_port]
        if new and self.model is not None:
            self._by_port.update(sensitivities(self.model, self.rows, new))
        return self._by_port

    def columns(self, effect: Effect, shape: ConstantValues) -> FloatArray:
        """(N, m, P) derivatives of the prediction (mm) by each parameter of the effect."""
        basis, _ = evaluate_basis(effect, self.rows, shape, None)
        return self.propagated(effect, basis)

    def propagated(self, effect: Effect, basis: FloatArray) -> FloatArray:
        """(N, m, P) changes of the prediction (mm) by what is added at the effect's ports (N, sum of sizes, P), mm."""
        added = split_by_port(effect, self.rows, basis)
        if self.model is None:
            return self.along_ends(external_change(added, self.axes, self.of_links))
        by_port = self.sensitivity(effect.ports)
        changes = [self.shown(by_port[port]) @ values for port, values in added.items()]
        return np.asarray(sum(changes[1:], start=changes[0]))

    @cached_property
    def registration_columns(self) -> FloatArray:
        """(N, m, Q) derivatives (mm) of what is always fitted along; none of a machine's own frame, Q = 0.

        Of an instrument's frame its small motion; of fixed ends their places; of an external model a constant of each
        coordinate, because where its zero lies says nothing about the machine.
        """
        if self.ends is not None:
            return self.ends.columns(self.nominal_tip_mm)
        if self.registered:
            seen_M_mm = self._seen_M_mm
            columns = registration_columns(seen_M_mm, self.axes, seen_M_mm)
            place = self._place_columns
            spread_mm = points_spread_mm(seen_M_mm)
            if self.with_attitude:
                columns = attitude_registration_columns(columns, place, self.rows.rotation_M_P, spread_mm)
            else:
                columns = np.concatenate([columns, place], axis=2)
            return columns[:, :, self._fitted_along(columns.shape[2], place.shape[2])]
        if self.model is None:
            return displacement_columns(*self.measured_mm.shape)
        return np.zeros((*self.measured_mm.shape, 0))

    @property
    def _seen_M_mm(self) -> FloatArray:
        """(N, 3) the tip of the rows, or the reflector that was measured in its place."""
        return target_M_mm(self.rows.tip_M_mm, self.rows.rotation_M_P, self.recording.target_P_mm)

    @property
    def _place_columns(self) -> FloatArray:
        """(N, 3, K) derivatives of the measured tip by the place of the target on the platform."""
        if self.target is None:
            return np.zeros((len(self.rows), len(self.axes), 0))
        return np.asarray(self.rows.rotation_M_P @ self.target.directions_P)

    def _fitted_along(self, count: int, places: int) -> list[int]:
        """Those of the registration's columns that are not held. count : of all.  places : of the target's place."""
        if not self.held:
            return list(range(count))
        frame = [f"frame.{name}" for name in "xyzabc"] if len(self.axes) == 3 else [""] * (count - places)
        names = [*frame, *[""] * places, *(f"target.{name}" for name in "abc" if self.with_attitude)]
        return [k for k, name in enumerate(names) if name not in self.held]

    @cached_property
    def gaps_filled(self) -> AlignedRecording:
        """The same recording, single empty cells of its quantities filled from the nearest row in time.

        For what describes a residual; what the effects of a model compute is never made of filled values.
        """
        most, time_s = self.criteria.max_filled_share, self.rows.time_s
        quantities = {name: filled(values, time_s, most) for name, values in self.rows.quantities.items()}
        if all(values is self.rows.quantities[name] for name, values in quantities.items()):
            return self
        return replace(self, rows=replace(self.rows, quantities=quantities))

    @cached_property
    def conditions(self) -> FloatArray:
        """(N, K) what was recorded beside the reference: where the machine was, and every quantity."""
        quantities = [values for name, values in self.rows.quantities.items() if not is_sensitivity(name)]
        return np.column_stack([self.rows.tip_M_mm, self.rows.scale_mm, *quantities])

    def lone_distance(self, distance: FloatArray, use: BoolArray) -> float:
        """Beyond which the repeats of a visit do not confirm each other; inf where no visit is a lone one.

        distance : (N,) of each row from what is known, in robust standard deviations.  use : (N,) rows that count.
        """
        use = use & ~np.isin(self.recording.row, list(self.recording.sidecar.trusted))
        return lone_distance(distance, use, self.recording.visit, self.conditions, self.criteria)

    def unconfirmed(self, outlier: BoolArray, residual_um: FloatArray, use: BoolArray) -> BoolArray:
        """(N,) those of the outliers that no repeat among the rows `use` (N,) confirms."""
        limits = outlier_limits(residual_um, use, self.recording.visit, self.criteria, self.conditions)
        return limits.unconfirmed(outlier, residual_um, use, self.recording.visit)

    @cached_property
    def usable(self) -> UsableRows:
        """Rows with every gauge and reference value and a pose; why the others are left out."""
        recording = self.recording
        # a link's length needs neither the frame nor the other links' references
        needed = [*recording.gauge_columns, *recording.reference_columns, *recording.model_columns]
        mask, left, reason = recording.usable(needed)
        left_out = {**recording.left_out, **left}
        at_pose = self.model is not None and self.ends is None
        predicted = self.rows.origin_M_mm if at_pose else self.predicted_mm({})
        nowhere = mask & ~np.isfinite(predicted).all(axis=1)
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
        attitude = measured_attitude(measured, self.registration, self.target_turn)
        return attitude_mm(attitude, predict(self.model, self.rows, added).rotation_M_P) * UM_PER_MM

    @cached_property
    def target_turn(self) -> FloatArray | None:
        """(3, 3) how the instrument's target is turned on the platform; None where nothing is to be found of it."""
        measured = self.recording.reference_rotation_rad
        if measured is None or self.held >= HELD["target.attitude"]:
            return None
        return target_turn(measured, self.rows.rotation_M_P, self.registration)

    def _why_no_pose(self, rows: BoolArray) -> str:
        if self.model is None:
            return "the model's prediction is empty"
        reasons = predict(self.model, self.rows, {}).reason[rows]
        return "no pose: " + "; ".join(Reason(int(code)).meaning for code in np.unique(reasons[reasons > 0]))


def _in_unit(effect: Effect, unit: str) -> Effect:
    """An effect whose numbers are in um, in the unit of the reference, one of which counts as a um."""
    if unit == "um" or effect.gives or "reference" not in effect.ports:
        return effect
    numbers = tuple(
        replace(one, unit=re.sub(r"^um(?=$|/)", unit, one.unit)) if re.match(r"um(?!/m\b)", one.unit) else one
        for one in effect.parameters
    )
    return effect if numbers == effect.parameters else replace(effect, parameters=numbers)


def effect_deltas(fitted: Sequence[FittedEffect], rows: Observations) -> tuple[dict[str, Deltas], Deltas]:
    """What each effect adds at its ports, by the effect's id; and the sum over all effects.

    Raises CompdError with everything that the effects need and the recording has not.
    """
    problems = [
        problem
        for effect in fitted
        for problem in unmet_needs(effect.effect, rows.available, rows.links, rows.quantities_at_zero)
    ]
    if problems:
        raise CompdError(problems)
    by_effect, _ = deltas_by_effect(fitted, rows, {})
    return by_effect, sum_deltas(list(by_effect.values()))
