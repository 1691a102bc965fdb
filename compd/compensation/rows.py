"""The arguments of a compensation as its kernel takes them: N rows, contiguous, of float64."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.compensation.values import GaugeValues, Wanted, WarmStart
from compd.errors import CompdError
from compd.model import MachineModel
from compd.model.kernels import GaugeRows, WantedRows, WarmRows
from compd.reference_conditions import value_at_zero


class Rows(NamedTuple):
    """The arguments of a compensation as the kernel takes them: N rows, contiguous, of float64.

    lead : the leading axes of the result; () for a single snapshot.
    quantities : (N, q + z), those that the effects need and those from which they count, as in the model's program.
    wanted : not filled where nothing is wanted.  warm : one row, or N.
    """

    lead: tuple[int, ...]
    gauges: GaugeRows
    quantities: FloatArray
    wanted: WantedRows
    warm: WarmRows


def kernel_rows(model: MachineModel, values: GaugeValues, warm: WarmStart, wanted: Wanted | None) -> Rows:
    lead = _lead(values, warm, wanted)
    count = math.prod(lead)
    at_zero = values.quantities_at_zero
    columns: list[FloatArray | float] = [_quantity(values.quantities, name) for name in model.program.quantities]
    for name, value in model.program.references:
        columns.append(value_at_zero(name, at_zero) if value is None else value)
    quantities = np.empty((count, len(columns)))
    if lead:
        for index, column in enumerate(columns):
            quantities[:, index] = column
    else:  # one assignment takes a tenth of the time of many
        quantities[0] = columns
    starts_lead = lead if warm.supports_M_mm.ndim > 2 else ()
    return Rows(
        lead,
        GaugeRows(
            _row_copy(values.scale_mm, lead, 1),
            _row_copy(values.joint_mm, lead, 1),
            _row_copy(values.frame_mm, lead, 1),
            _row_copy(values.time_s, lead, 0),
        ),
        quantities,
        _wanted_rows(wanted, lead, count) if wanted else _UNREAD if count == 1 else _unread(count),
        WarmRows(
            _row_copy(warm.supports_M_mm, starts_lead, 2),
            _row_copy(warm.origin_M_mm, starts_lead, 1),
            _row_copy(warm.rotation_M_P, starts_lead, 2),
            _row_copy(model.zero.actuator_mm if warm.actuator_mm is None else warm.actuator_mm, starts_lead, 1),
        ),
    )


def _lead(values: GaugeValues, warm: WarmStart, wanted: Wanted | None) -> tuple[int, ...]:
    """The leading axes of all arguments together."""
    parts = [
        (values.joint_mm, 1), (values.frame_mm, 1),
        (warm.supports_M_mm, 2), (warm.origin_M_mm, 1), (warm.rotation_M_P, 2),
    ]  # fmt: skip
    if wanted:
        parts += [(wanted.tip_M_mm, 1), (wanted.tip_P_mm, 1), (wanted.attitude_M_P, 2)]
    else:
        parts.append((values.scale_mm, 1))
    for part, core in parts:
        if part.ndim > core:
            return np.broadcast_shapes(*(part.shape[: part.ndim - core] for part, core in parts))
    return ()


def _wanted_rows(wanted: Wanted, lead: tuple[int, ...], count: int) -> WantedRows:
    rows = WantedRows(np.empty((count, 6)), np.empty((count, 3, 3)))
    rows.target_mm[:, :3] = _over(lead, wanted.tip_M_mm, 1)
    rows.target_mm[:, 3:] = _over(lead, wanted.tip_P_mm, 1)
    rows.attitude_M_P[:] = _over(lead, wanted.attitude_M_P, 2)
    return rows


def _unread(count: int) -> WantedRows:
    return WantedRows(np.empty((count, 6)), np.empty((count, 3, 3)))


# What is handed over where nothing is wanted: the kernel does not read it.
_UNREAD = _unread(1)


def _row_copy(values: FloatArray | float, lead: tuple[int, ...], core: int) -> FloatArray:
    """(N, ...): a contiguous copy, since the kernel takes no read-only array."""
    return np.array(_over(lead, values, core), dtype=np.float64, ndmin=core + 1, order="C")


def _over(lead: tuple[int, ...], values: FloatArray | float, core: int) -> FloatArray | float:
    """Values with one leading axis in place of `lead`; as they are where there is none."""
    if not lead:
        return values
    values = np.asarray(values)
    shape = values.shape[values.ndim - core :]
    return np.broadcast_to(values, (*lead, *shape)).reshape(math.prod(lead), *shape)


def _quantity(quantities: Mapping[str, FloatArray], name: str) -> FloatArray:
    if name not in quantities:
        raise CompdError.of(
            "rows for effects",
            "this quantity is not measured",
            value=name,
            allowed=", ".join(sorted(quantities)) or "nothing is",
            next_step="add a gauge or a column of this name",
        )
    return quantities[name]
