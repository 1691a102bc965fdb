"""What a declared effect adds at its port, per unit of each of its fitted parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from compd.arrays import FloatArray
from compd.model.effects import (
    Basis,
    BasisProgram,
    ConstantValues,
    Effect,
    Memory,
    Observations,
    Port,
    needed_quantities,
)
from compd.model.formula.columns import column_codes
from compd.model.formula.formula import Formula
from compd.model.formula.program import write_program
from compd.model.kernels import FORMULA

AXES = ("x", "y", "z")
# Ports that take a vector at each of their places; `reference` also a rotation.
VECTORS: tuple[Port, ...] = ("base_joint", "platform_joint", "plate", "tool", "reference")
_SENSITIVITY_COLUMNS: Mapping[Port, str] = {"reference": "d_{name}_{{axis}}_mm", "link": "d_{name}_link_{{link}}_mm"}
SENSITIVITY_PORTS: tuple[Port, ...] = tuple(_SENSITIVITY_COLUMNS)


@dataclass(frozen=True)
class FormulaBasis:
    """The basis of one formula, or of several along axes of a port of vectors."""

    formulas: Mapping[str, Formula]  #: axis -> formula; the axis is "" at a port without direction
    to_mm: float  #: what a formula's value of 1 is in mm

    def program(self, effect: Effect, links: int, sizes: Mapping[Port, int]) -> BasisProgram:
        """See `compd.model.effects.effect.CompiledBasis`."""
        (port,) = effect.ports
        along = 1 if "" in self.formulas else 6 if port == "reference" else 3
        places = 1 if port == "reference" else sizes[port] // along
        names = list(dict.fromkeys(name for formula in self.formulas.values() for name in formula.columns))
        program = write_program(
            {AXES.index(axis) if axis else 0: formula.tree for axis, formula in self.formulas.items()},
            [parameter.name for parameter in effect.parameters],
            [constant.name for constant in effect.constants],
            column_codes(names, port, links, needed_quantities(effect, links), effect.counts_from == "machine zero"),
            along,
            places,
            [parameter.per in ("link", "scale") for parameter in effect.parameters],
        )
        return BasisProgram(FORMULA, program.code, np.append(program.numbers, self.to_mm), program.states)


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
