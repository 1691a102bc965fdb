"""An effect's basis in N rows: what it adds at its ports per unit of each fitted number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from compd.arrays import BoolArray, FloatArray
from compd.errors import CompdError
from compd.link_count import scale_count
from compd.model.effects.effect import Basis, BasisProgram, ConstantValues, Effect, Memory, Port
from compd.model.effects.effect_needs import is_measured, needed_quantities
from compd.model.effects.observations import MachineConstants, Observations
from compd.model.kernels import basis_of_rows
from compd.model.structures import MACHINE, MAX_LINKS, ROW
from compd.reference_conditions import standard_value
from compd.units import UNIT_KINDS

# Rows whose structures exist at the same time: of 4000, they take 8 MB.
_ROWS_AT_ONCE = 4000
# Rows, spread evenly, in which an effect in Python is asked whether quantities change it.
_ROWS_TO_TRY = 8
# A larger value, as of exp(300), counts as none: sums of its squares are infinite.
_LARGEST = 1e100


def port_sizes(links: int, joints: int, axes: int) -> dict[Port, int]:
    """How many numbers each port takes on a machine with so many links, joint comparators and revolute axes."""
    return {
        "scale": scale_count(links),
        "joint": joints,
        "frame": 9,
        "link": links,
        "base_joint": 3 * links,
        "platform_joint": 3 * links,
        "revolute_axis": 3 * axes,
        "plate": 9,
        "tool": 3,
        "reference": 6,
    }


def port_size(port: Port, rows: Observations) -> int:
    """How many numbers a port takes on the machine of these rows."""
    return port_sizes(rows.links, rows.joint_mm.shape[1], len(rows.revolute_axes_P))[port]


def evaluate_basis(
    effect: Effect, rows: Observations, constants: ConstantValues, memory: Memory
) -> tuple[FloatArray, Memory]:
    """The basis (N, sum of port sizes, P), mm (rad for directions) per unit, and the memory after the rows.

    An effect that counts from machine zero does so from the quantities of the rows there; where these do not have them,
    from the standard conditions.
    memory : None at the start.  Raises CompdError where a quantity that the effect needs is not measured, or was not at
    machine zero.
    """
    effect = counted_from(effect, rows)
    if callable(effect.basis):
        return _python_basis(effect, effect.basis, rows, constants, memory)
    sizes = port_sizes(rows.links, rows.joint_mm.shape[1], len(rows.revolute_axes_P))
    program = effect.basis.program(effect, rows.links, sizes)
    basis = np.zeros((len(rows), sum(sizes[port] for port in effect.ports), len(effect.columns(rows.links))))
    remembered = pack_memory(program.states, memory)
    numbers = program_numbers(effect, program, constants)
    machine = machine_structure(rows.constants)
    names = needed_quantities(effect, rows.links)
    quantities = np.zeros((len(rows), 2 * len(names)))
    for place, name in enumerate(names):
        quantities[:, place] = rows.quantity(name)
        from_zero = effect.counts_from == "machine zero"
        quantities[:, len(names) + place] = rows.reference_value(name) if from_zero else standard_value(name)
    for begin in range(0, len(rows), _ROWS_AT_ONCE):
        chunk = slice(begin, begin + _ROWS_AT_ONCE)
        basis_of_rows(
            program.number,
            row_structures(rows, chunk),
            machine,
            quantities[chunk],
            program.code,
            numbers,
            remembered,
            basis[chunk],
        )
        basis[chunk][np.abs(basis[chunk]) > _LARGEST] = np.nan
    ratio = _in_unit_of_rows(effect, rows)
    return basis if ratio == 1.0 else basis * ratio, unpack_memory(program.states, remembered)


def _in_unit_of_rows(effect: Effect, rows: Observations) -> float:
    """The factor from the angle that a formula gives to that of the rows' reference; 1 where one of them is none."""
    angles = {**UNIT_KINDS[2], "um/m": 1e-6}
    if effect.gives not in angles or rows.unit not in angles:
        return 1.0
    return angles[effect.gives] / angles[rows.unit]


def counted_from(effect: Effect, rows: Observations) -> Effect:
    """The effect as it counts in these rows: from 20 degC where their quantities at machine zero are not known."""
    if effect.counts_from == "machine zero" and rows.quantities_at_zero is None and is_measured(effect):
        return replace(effect, counts_from="20 degC")
    return effect


def recounted(effect: Effect, rows: Observations) -> Effect:
    """The effect as it counts when it is fitted anew on these rows."""
    if effect.counts_from == "20 degC":
        effect = replace(effect, counts_from="machine zero")
    return counted_from(effect, rows)


def _python_basis(
    effect: Effect, basis: Basis, rows: Observations, constants: ConstantValues, memory: Memory
) -> tuple[FloatArray, Memory]:
    """Of an effect in Python; where it counts from machine zero, less what these rows give with the quantities there.

    Its memory has then the effect's own arrays and, behind them, those of the rows with the quantities at machine zero.
    """
    if effect.counts_from != "machine zero":
        return basis(rows if rows.quantities_at_zero is None else rows.from_standard, constants, memory)
    if not is_measured(effect):
        return basis(rows, constants, memory)
    for name in needed_quantities(effect, rows.links):
        if name in rows.quantities:
            rows.reference_value(name)  # raises where it was not measured at machine zero
    own, at_zero = (None, None) if memory is None else (memory[: len(memory) // 2], memory[len(memory) // 2 :])
    values, own = basis(rows, constants, own)
    reference, at_zero = basis(rows.with_quantities_at_zero, constants, at_zero)
    after = None if own is None or at_zero is None else (*own, *at_zero)
    if not reference.any():
        return values, after
    counted = (values != reference).any(axis=(0, 1)) | _changed_by_quantities(basis, rows, constants)
    return values - np.where(counted, reference, 0.0), after


def _changed_by_quantities(basis: Basis, rows: Observations, constants: ConstantValues) -> BoolArray:
    """(P,) which columns other quantities than those at machine zero change, in some of the rows.

    The rows' own quantities do not say it where they are as they were at machine zero. The rows are without history:
    in its first row a lag shows what goes into it.
    """
    few = rows.select(np.unique(np.linspace(0, len(rows) - 1, _ROWS_TO_TRY).astype(np.int64)))
    few = replace(few, session_start=np.ones(len(few), dtype=bool))
    reference, _ = basis(few.with_quantities_at_zero, constants, None)
    changed = np.zeros(reference.shape[2], dtype=bool)
    for sign in (1.0, -1.0):
        # each by another amount: a difference of two quantities changes, too
        other = {
            name: values + sign * (1.0 + 0.1 * place)
            for place, (name, values) in enumerate(few.with_quantities_at_zero.quantities.items())
        }
        try:
            with np.errstate(all="ignore"):
                changed |= (basis(replace(few, quantities=other), constants, None)[0] != reference).any(axis=(0, 1))
        except (ArithmeticError, LookupError, ValueError):
            changed[:] = True  # a value that it does not take is one that it reads, in which columns nobody knows
    return changed


def program_numbers(effect: Effect, program: BasisProgram, constants: ConstantValues) -> FloatArray:
    """The nonlinear constants in the order of the effect's entry, then the program's own numbers."""
    return np.concatenate([[constants[constant.name] for constant in effect.constants], program.numbers])


def pack_memory(states: Sequence[int], memory: Memory) -> FloatArray:
    """The arrays of a memory behind one another; nan at the start."""
    if memory is None:
        return np.full(sum(states), np.nan)
    return np.concatenate(memory)


def unpack_memory(states: Sequence[int], packed: FloatArray) -> Memory:
    """The arrays of a memory; None for an effect that remembers nothing."""
    if not states:
        return None
    return tuple(np.split(packed, np.cumsum(states)[:-1]))


def row_structures(rows: Observations, chunk: slice) -> NDArray[np.void]:
    """These rows as kernels read them. Raises CompdError for a machine with more links than there is room for."""
    if rows.links > MAX_LINKS:
        raise CompdError.of(
            "rows for effects",
            "has too many links",
            value=str(rows.links),
            allowed=f"{MAX_LINKS} at most",
            next_step="record the tip instead of the links' lengths",
        )
    structures = np.zeros(len(rows.time_s[chunk]), dtype=ROW)
    structures["links"], structures["scales"] = rows.links, scale_count(rows.links)
    for name in (ROW.names or ())[2:]:
        values = getattr(rows, name)[chunk]
        if ROW[name].shape and values.shape[1:] != ROW[name].shape:
            structures[name][:, : values.shape[1]] = values
        else:
            structures[name] = values
    return structures


def machine_structure(constants: MachineConstants) -> NDArray[np.void]:
    """What all rows of a machine have in common, (1,), as kernels read it."""
    structure = np.zeros(1, dtype=MACHINE)
    machine = structure[0]
    machine["links"], machine["axes"] = len(constants.platform_joints_P_mm), len(constants.revolute_axes_P)
    machine["tool_mm"], machine["tool_on_plate"] = constants.arrangement.tool_mm, constants.arrangement.on_plate
    for name in ("weight_N", "weight_at_P_mm", "frame_zero_mm", "plate_points_M_mm", "plate_thickness_mm"):
        machine[name] = getattr(constants, name)
    machine["instrument_M_mm"] = constants.instrument_M_mm
    machine["zero_rotation_M_P"] = math.nan if constants.zero is None else constants.zero.rotation_M_P
    for name in (
        *("platform_joints_P_mm", "revolute_axes_P", "hinges", "zero_directions_M", "zero_axes_M"),
        *("zero_axial_force_N", "zero_axial_per_force", "scale_of_link"),
    ):
        values = getattr(constants, name)
        machine[name][: len(values)] = values
    if constants.actuators is not None and constants.zero is not None:
        for name in ("kinds", "cosine_M", "sine_M", "radius_mm"):
            values = getattr(constants.actuators, name)
            machine[name][: len(values)] = values
        machine["zero_actuator_mm"][: len(constants.zero.actuator_mm)] = constants.zero.actuator_mm
    return structure
