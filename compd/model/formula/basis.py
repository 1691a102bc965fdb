"""What a declared effect adds at its port, per unit of each of its fitted parameters."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from compd.arrays import FloatArray
from compd.model.deltas import port_size
from compd.model.effect import Basis, ConstantValues, Memory, Port
from compd.model.formula.columns import column_values
from compd.model.formula.evaluator import Formula
from compd.model.observations import Observations

AXES = ("x", "y", "z")
# Ports that take a vector at each of their places; `reference` also a rotation.
VECTORS: tuple[Port, ...] = ("base_joint", "platform_joint", "plate", "tool", "reference")
_SENSITIVITY_COLUMNS: Mapping[Port, str] = {"reference": "d_{name}_{{axis}}_mm", "link": "d_{name}_link_{{link}}_mm"}
SENSITIVITY_PORTS: tuple[Port, ...] = tuple(_SENSITIVITY_COLUMNS)


def formula_basis(
    formulas: Mapping[str, Formula], port: Port, to_mm: float, linear: Sequence[str], per_link: Collection[str]
) -> Basis:
    """The basis of one formula, or of several along axes of a port of vectors.

    formulas : axis -> formula; the axis is "" at a port without direction.
    to_mm : what a formula's value of 1 is in mm.
    linear : the fitted parameters in their order.  per_link : those of them with one value per link.
    """

    def basis(rows: Observations, constants: ConstantValues, memory: Memory) -> tuple[FloatArray, Memory]:
        along = 1 if "" in formulas else 6 if port == "reference" else 3
        places = 1 if port == "reference" else port_size(port, rows) // along
        widths = [places if name in per_link else 1 for name in linear]
        begin = dict(zip(linear, np.cumsum([0, *widths]).tolist(), strict=False))
        values = np.zeros((len(rows), places, along, sum(widths)))
        after: list[FloatArray] = []
        states = list(_lag_states(memory, sum(formula.lags for formula in formulas.values())))
        for axis, formula in formulas.items():
            columns = {name: column_values(rows, name, port) for name in formula.columns}
            own_states, states = states[: formula.lags], states[formula.lags :]
            factors, states_after = formula.evaluate(
                columns, constants, rows.time_s, rows.session_start, tuple(own_states)
            )
            after += [array for state in states_after if state is not None for array in state]
            for name, factor in factors.items():
                column = to_mm * np.broadcast_to(factor, (len(rows), places))
                place = AXES.index(axis) if axis else 0
                if name in per_link:
                    values[:, :, place, begin[name] : begin[name] + places] = column[:, :, None] * np.eye(places)
                else:
                    values[:, :, place, begin[name]] = column
        return values.reshape(len(rows), places * along, -1), tuple(after) or None

    return basis


def sensitivity_basis(name: str, port: Port) -> Basis:
    """The basis of an effect whose parameter moves the prediction by recorded derivatives, mm per unit.

    An axis whose column is not recorded is not moved.
    """

    def basis(rows: Observations, constants: ConstantValues, memory: Memory) -> tuple[FloatArray, Memory]:
        if port == "link":
            columns = [rows.quantity(f"d_{name}_link_{i + 1}_mm") for i in range(rows.links)]
        else:
            none = np.zeros(len(rows))
            columns = [rows.quantities.get(f"d_{name}_{axis}_mm", none) for axis in AXES] + [none] * 3
        return np.stack(columns, axis=1)[:, :, None], memory

    return basis


def sensitivity_columns(name: str, port: Port) -> str:
    """The columns that hold the derivatives by a parameter, as an effect needs them: `{axis}` or `{link}` is open."""
    return _SENSITIVITY_COLUMNS[port].format(name=name)


def lagged_states(lags: int) -> tuple[int, ...]:
    """Where in the memory of a formula with so many lags what is behind each of them stands."""
    return tuple(3 * i + 2 for i in range(lags))


def _lag_states(memory: Memory, lags: int) -> tuple[tuple[FloatArray, ...] | None, ...]:
    """The states of so many lags, three arrays each, from an effect's memory."""
    return tuple(None if memory is None else memory[3 * i : 3 * i + 3] for i in range(lags))
