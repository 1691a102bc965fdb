"""A formula's program, run on one instant: a stack of numbers, and one operation after the other.

`compd.model.formula.program` writes programs. A program is a table of integers, two in each row::

    along, places            numbers at each place of the port (3 for a vector), places
    lanes, 0                 2 where measured quantities count from machine zero, else 1
    lags, columns
    axes, parameters         formulas, one for each axis that has one; fitted parameters
    begin, width             of each lag: where its memory begins, for how many places it has one
    kind, argument           of each column: see `_column`
    begin, own               of each parameter: its first column of the basis; 1 where each place has its own
    axis, operations         of each formula; then its operations, with an argument each

A formula computes each of its lags into a register, and then one factor for each parameter: what it is multiplied by.
With two lanes everything is computed twice: as it is now, and at the same pose with the measured quantities as at
machine zero. A factor that holds a measured quantity is the difference of the two, and so is what goes into a lag.
"""

from __future__ import annotations

import math

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.jit import INDEX_ROWS, NUMBERS, ROW_MATRICES, helper, loop
from compd.model.kernels.link_forces import axial_force_at_zero, set_axial_forces
from compd.model.kernels.memory import lag_step
from compd.model.structures import EffectMachine, EffectRow

# Operations: each takes its operands from the stack, the last one on top, and leaves its result there. The argument of
# the first seven is the place of a number, a column, a register, a lag or a parameter. Those since zero are of values
# that hold a measured quantity.
NUMBER, COLUMN, REGISTER, LAG, FACTOR, LAG_SINCE_ZERO, FACTOR_SINCE_ZERO = range(7)
ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, NEGATE = range(10, 16)
SIN, COS, TAN, ATAN2, EXP, LOG, SQRT, ABS, SIGN, MINIMUM, MAXIMUM = range(20, 31)

# Columns: what an instant has once, what each place has, and quantities, once or for each place.
TIME, TIP, SCALE, LINK, DIRECTION, VELOCITY, AXIAL_FORCE, JOINT, FRAME, QUANTITY, QUANTITY_OF_PLACE = range(11)

_HEADER = 4
NOW, AT_ZERO = range(2)
# What a place is of which a column of the scales is read.
AT_LINK, AT_SCALE = range(2)
# Deeper than any formula may be nested (`compd.model.formula.parser.DEEPEST`): two operands for each level, and a sum.
STACK = 64


@helper
def set_formula_basis(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    code: IntArray,
    numbers: FloatArray,
    memory: FloatArray,
    basis: FloatArray,
) -> None:
    """The basis of an effect that is written as formulas.

    code (L, 2) : the program.  numbers : its numbers; the last one is what a formula's value of 1 is in mm.
    memory, basis : as for the kernels of `compd.model.kernels.effects`.
    """
    along, places = code[0]
    lanes = code[1, 0]
    lags, count = code[2]
    axes, parameters = code[3]
    column_at = _HEADER + lags
    parameter_at = column_at + count
    at_zero = quantities[quantities.shape[0] // 2 :]
    columns = np.empty((lanes, count))
    registers = np.full((lanes, lags), math.nan)
    factors = np.empty(parameters)
    axial_N = np.empty((2, row.links))
    for c in range(count):
        if code[column_at + c, 0] == AXIAL_FORCE:
            begin = code[column_at + c, 1]
            set_axial_forces(row, machine, quantities[begin : begin + 3], axial_N[NOW])
            for i in range(row.links):
                axial_N[AT_ZERO, i] = axial_force_at_zero(machine, at_zero[begin : begin + 3], i)
    to_mm = numbers[numbers.shape[0] - 1]
    for place in range(places):
        for c in range(count):
            kind, argument = code[column_at + c]
            columns[NOW, c] = _column(row, machine, quantities, axial_N[NOW], kind, argument, place)
            if lanes > 1:
                columns[AT_ZERO, c] = _column(row, machine, at_zero, axial_N[AT_ZERO], kind, argument, place)
        at = parameter_at + parameters
        for _ in range(axes):
            axis, operations = code[at]
            factors[:] = 0.0
            at += 1
            _run(
                code[at : at + operations],
                code[_HEADER:column_at],
                numbers,
                columns,
                row.time_s,
                row.session_start != 0,
                place,
                registers,
                memory,
                factors,
            )
            at += operations
            for p in range(parameters):
                column, own = code[parameter_at + p]
                basis[place * along + axis, column + place * own] = to_mm * factors[p]


@helper
def _scale_at(machine: EffectMachine, at: int, place: int) -> int:
    """The scale of a place, AT_SCALE or AT_LINK."""
    return place if at == AT_SCALE else machine.scale_of_link[place]


@helper
def _column(
    row: EffectRow,
    machine: EffectMachine,
    quantities: FloatArray,
    axial_N: FloatArray,
    kind: int,
    argument: int,
    place: int,
) -> float:
    """The value of a column: the axis of the tip, where a quantity stands, and what a place is, are its argument."""
    if kind == TIME:
        return float(row.time_s)
    if kind == TIP:
        return float(row.tip_M_mm[argument])
    if kind == SCALE:
        return float(row.scale_mm[_scale_at(machine, argument, place)])
    if kind == LINK:
        return float(row.link_mm[place])
    if kind == DIRECTION:
        return float(row.direction[_scale_at(machine, argument, place)])
    if kind == VELOCITY:
        return float(row.velocity_mm_per_s[_scale_at(machine, argument, place)])
    if kind == AXIAL_FORCE:
        return float(axial_N[place])
    if kind == JOINT:
        return float(row.joint_mm[place])
    if kind == FRAME:
        return float(row.frame_mm[place])
    return float(quantities[argument + place if kind == QUANTITY_OF_PLACE else argument])


@helper
def _run(  # noqa: PLR0912  one branch for each kind of operation
    operations: IntArray,
    lags: IntArray,
    numbers: FloatArray,
    columns: FloatArray,
    time_s: float,
    session_start: bool,
    place: int,
    registers: FloatArray,
    memory: FloatArray,
    factors: FloatArray,
) -> None:
    """One formula at one place. What is not finite in the end (log of a negative, exp of a large number) is nan.

    columns (lanes, C), registers (lanes, L) : now, and at machine zero.
    """
    lanes = columns.shape[0]
    stack = np.empty((lanes, STACK))
    top = -1
    for k in range(operations.shape[0]):
        operation, argument = operations[k]
        if operation in (NUMBER, COLUMN, REGISTER):
            top += 1
            for lane in range(lanes):
                if operation == NUMBER:
                    stack[lane, top] = numbers[argument]
                else:
                    stack[lane, top] = columns[lane, argument] if operation == COLUMN else registers[lane, argument]
        elif operation in (FACTOR, FACTOR_SINCE_ZERO):
            value = stack[NOW, top]
            if operation == FACTOR_SINCE_ZERO:
                value -= stack[AT_ZERO, top]
            factors[argument] = value if math.isfinite(value) else math.nan
            top -= 1
        elif operation in (LAG, LAG_SINCE_ZERO):
            begin, width = lags[argument]
            if place < width:  # one of a value that all places share is computed once
                # at machine zero what is lagged had been as it was then for long
                constant = stack[AT_ZERO, top - 1] if operation == LAG_SINCE_ZERO else 0.0
                value = stack[NOW, top - 1] - constant
                lagged = _lag(
                    value, stack[NOW, top], time_s, session_start, memory[begin : begin + 3 * width], place, width
                )
                registers[:, argument] = lagged + constant
                if operation == LAG_SINCE_ZERO:
                    registers[AT_ZERO, argument] = constant
            top -= 2
        elif operation in (ADD, SUBTRACT, MULTIPLY, DIVIDE, POWER, ATAN2, MINIMUM, MAXIMUM):
            top -= 1
            for lane in range(lanes):
                stack[lane, top] = _of_two(operation, stack[lane, top], stack[lane, top + 1])
        else:
            for lane in range(lanes):
                stack[lane, top] = _of_one(operation, stack[lane, top])


@helper
def _lag(value: float, tau_s: float, time_s: float, starts: bool, memory: FloatArray, place: int, width: int) -> float:
    """The lagged value; the memory has the times of all places, then their values, then the lagged ones."""
    if math.isnan(value):
        return math.nan  # and is left out of the memory: the next one follows on the last that was known
    lagged = lag_step(time_s, value, starts, tau_s, memory[place], memory[width + place], memory[2 * width + place])
    memory[place] = time_s
    memory[width + place] = value
    memory[2 * width + place] = lagged
    return lagged


@helper
def _of_one(operation: int, x: float) -> float:
    if operation == NEGATE:
        return -x
    if operation == SIN:
        return math.sin(x)
    if operation == COS:
        return math.cos(x)
    if operation == TAN:
        return math.tan(x)
    if operation == EXP:
        return math.exp(x)
    if operation == LOG:
        return float(np.log(x))
    if operation == SQRT:
        return float(np.sqrt(x))
    if operation == ABS:
        return abs(x)
    return float(np.sign(x))


@helper
def _of_two(operation: int, x: float, y: float) -> float:
    if operation == ADD:
        return x + y
    if operation == SUBTRACT:
        return x - y
    if operation == MULTIPLY:
        return x * y
    if operation == DIVIDE:
        return x / y
    if operation == POWER:
        return float(x**y)
    if operation == ATAN2:
        return math.atan2(x, y)
    if math.isnan(x) or math.isnan(y):
        return math.nan
    return min(x, y) if operation == MINIMUM else max(x, y)


@loop([INDEX_ROWS, NUMBERS, ROW_MATRICES, NUMBERS, NUMBERS, NUMBERS, ROW_MATRICES])
def formula_factors(
    code: IntArray,
    numbers: FloatArray,
    columns: FloatArray,
    time_s: FloatArray,
    session_start: FloatArray,
    memory: FloatArray,
    factors: FloatArray,
) -> None:
    """The factors (N, m, P) of a single formula, from the values of its columns (N, m, C); row after row.

    session_start (N,) : not 0 where a row has no history.
    """
    lags = code[2, 0]
    begin = _HEADER + lags + code[2, 1] + code[3, 1]
    registers = np.full((1, lags), math.nan)
    for k in range(columns.shape[0]):
        for place in range(columns.shape[1]):
            _run(
                code[begin + 1 : begin + 1 + code[begin, 1]],
                code[_HEADER : _HEADER + lags],
                numbers,
                columns[k, place : place + 1],
                time_s[k],
                session_start[k] != 0.0,
                place,
                registers,
                memory,
                factors[k, place],
            )
