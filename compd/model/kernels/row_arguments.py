"""What the kernels of a compensation take, as named tuples of arrays: N rows, contiguous, of float64."""

from __future__ import annotations

from typing import Any, NamedTuple

from compd.arrays import FloatArray, IntArray
from compd.jit import (
    COUNT,
    FLAG,
    INDEX_ROWS,
    INDICES,
    NUMBERS,
    ROW_MATRICES,
    ROWS,
    structure,
)
from compd.model.structures import EFFECT_MACHINE, EFFECTS, RESULTS, WORKSPACES


class EffectArrays(NamedTuple):
    """K effects of a machine."""

    machine: Any  #: (1,), of `compd.model.structures.effect_row.MACHINE`: what all rows have in common.
    effects: Any  #: (K,), of `compd.model.structures.solver_structures.EFFECT`.
    theta: FloatArray  #: theta, numbers, code: of all effects, behind one another
    numbers: FloatArray
    code: IntArray
    #: of each effect's quantities, now and then at machine zero, in a row of the program's `quantities` and
    #: `references` behind one another
    quantity_indices: IntArray
    targets: IntArray  #: of each effect's numbers among those of all ports


class GaugeRows(NamedTuple):
    """Changes since machine zero: scale_mm (N, m), joint_mm (N, k), frame_mm (N, 9), (N, 6) or (N, 0) where no
    comparator measures the frame; time_s (N,), monotonic.
    """

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    time_s: FloatArray


class WantedRows(NamedTuple):
    """What machine-tool mode is to reach.

    target_mm : (N, 6), the contact in {M} and in {P}.  attitude_M_P : (N, 3, 3).
    """

    target_mm: FloatArray
    attitude_M_P: FloatArray


class GivenRows(NamedTuple):
    """What is known of the effects before they are computed.

    effects_at_mm : (N, m), in machine-tool mode the scales at which effects are computed first; nan for the setpoint
        without effects.
    added_mm : (N, K, size), what effects without a kernel add.
    """

    effects_at_mm: FloatArray
    added_mm: FloatArray


class WarmRows(NamedTuple):
    """Where Newton starts: supports_M_mm (N, 3, 3), origin_M_mm (N, 3), rotation_M_P (N, 3, 3), actuator_mm (N, m); or
    one row for all."""

    supports_M_mm: FloatArray
    origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    actuator_mm: FloatArray


class PoseRows(NamedTuple):
    """Machines at poses, as in `compd.model.effects.Observations`; with the base's axes rotation_M_B (N, 3, 3)."""

    rotation_M_B: FloatArray
    base_joints_M_mm: FloatArray
    origin_M_mm: FloatArray
    rotation_M_P: FloatArray
    tip_M_mm: FloatArray
    scale_mm: FloatArray
    frame_mm: FloatArray


class MemoryArrays(NamedTuple):
    """What effects remember: before the first row and, when a kernel has ended, after the last.

    motion : a row of numbers, see `compd.model.kernels.motion`.  memories : of all effects, behind one another.
    """

    motion: FloatArray
    memories: FloatArray


class SolvedRows(NamedTuple):
    """What a kernel fills in.

    works : (1,), of WORKSPACE.  results : (N,), of RESULT.
    """

    works: Any
    results: Any


class RowOptions(NamedTuple):
    """How the rows are computed.

    machine_tool : in machine-tool mode, else in CMM mode.
    passes : how often effects are computed, each time at the setpoint of the time before.
    starts : the first row has no history.  other_mode : the motion before the first row is of the other mode.
    """

    machine_tool: bool
    passes: int
    starts: bool
    other_mode: bool


class TipDerivativeArrays(NamedTuple):
    """How far the tip moves, mm: by_port (3, size), by_theta (3, P), by_quantity (3, q)."""

    by_port: FloatArray
    by_theta: FloatArray
    by_quantity: FloatArray


EFFECT_ARRAYS = structure(
    EffectArrays,
    machine=EFFECT_MACHINE,
    effects=EFFECTS,
    theta=NUMBERS,
    numbers=NUMBERS,
    code=INDEX_ROWS,
    quantity_indices=INDICES,
    targets=INDICES,
)
GAUGE_ROWS = structure(GaugeRows, scale_mm=ROWS, joint_mm=ROWS, frame_mm=ROWS, time_s=NUMBERS)
WANTED_ROWS = structure(WantedRows, target_mm=ROWS, attitude_M_P=ROW_MATRICES)
GIVEN_ROWS = structure(GivenRows, effects_at_mm=ROWS, added_mm=ROW_MATRICES)
WARM_ROWS = structure(
    WarmRows, supports_M_mm=ROW_MATRICES, origin_M_mm=ROWS, rotation_M_P=ROW_MATRICES, actuator_mm=ROWS
)
POSE_ROWS = structure(
    PoseRows,
    rotation_M_B=ROW_MATRICES,
    base_joints_M_mm=ROW_MATRICES,
    origin_M_mm=ROWS,
    rotation_M_P=ROW_MATRICES,
    tip_M_mm=ROWS,
    scale_mm=ROWS,
    frame_mm=ROWS,
)
MEMORY_ARRAYS = structure(MemoryArrays, motion=NUMBERS, memories=NUMBERS)
SOLVED_ROWS = structure(SolvedRows, works=WORKSPACES, results=RESULTS)
ROW_OPTIONS = structure(RowOptions, machine_tool=FLAG, passes=COUNT, starts=FLAG, other_mode=FLAG)
TIP_DERIVATIVE_ARRAYS = structure(TipDerivativeArrays, by_port=ROWS, by_theta=ROWS, by_quantity=ROWS)
