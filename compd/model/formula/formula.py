"""A checked formula, and its value for arrays."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.model.formula.program import ColumnCodes, write_program
from compd.model.kernels import formula as machine_code


@dataclass(frozen=True)
class Formula:
    """A checked formula.

    linear : parameters to which it is proportional, in the order declared.  constants : the other parameters.
    columns : names of everything else in it.  lags : how many lag(x, tau) it holds.
    """

    text: str
    tree: ast.expr
    linear: tuple[str, ...]
    constants: tuple[str, ...]
    columns: tuple[str, ...]
    lags: int

    def evaluate(
        self,
        columns: Mapping[str, FloatArray],
        constants: Mapping[str, float],
        time_s: FloatArray,
        session_start: BoolArray,
    ) -> dict[str, FloatArray]:
        """What each linear parameter is multiplied by, (N, m).

        columns : (N, m) or (N, 1) by name, all of one m or 1.  constants : values of the other parameters.
        time_s (N,), session_start (N,) : for its lags.  Where the arithmetic fails (log of a negative, exp of a large
        one) the value is nan.
        """
        rows = len(time_s)
        places = max((columns[name].shape[1] for name in self.columns), default=1)
        own = frozenset(name for name in self.columns if columns[name].shape[1] > 1)
        # a column's kind is of no importance here: its values are at hand
        codes = dict.fromkeys(self.columns, (0, 0))
        program = write_program(
            {0: self.tree}, self.linear, self.constants, ColumnCodes(codes, own), 1, places, [False] * len(self.linear)
        )
        values = np.zeros((rows, places, len(self.columns)))
        for index, name in enumerate(self.columns):
            values[:, :, index] = columns[name]
        factors = np.zeros((rows, places, len(self.linear)))
        numbers = np.concatenate([[constants[name] for name in self.constants], program.numbers])
        machine_code.formula_factors(
            program.code,
            numbers,
            values,
            np.ascontiguousarray(time_s, dtype=np.float64),
            np.ascontiguousarray(session_start, dtype=np.float64),
            np.full(sum(program.states), np.nan),
            factors,
        )
        return {name: factors[:, :, index] for index, name in enumerate(self.linear)}
