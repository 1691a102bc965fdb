"""A constant of the measured coordinates: no effect's signature, and part of what many effects do."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison import AlignedRecording
from compd.diagnosis.candidates.candidates import Candidate
from compd.display_unit import ATTITUDE_LABELS, ATTITUDE_UNIT, MM_PER_RAD
from compd.model.effects import ConstantValues, Effect, Observations, Parameter, memoryless_basis
from compd.statistics import column_norms, solve_least_squares
from compd.units import UM_PER_MM

CONSTANT = "constant"
MM_PER_UM = 1 / UM_PER_MM
# Columns of which less than this share of the squares lies outside a subspace are part of it: rounding of the forward
# model, which is linear within 1e-5.
MIN_OUTSIDE = 1e-4


def constant_candidate(aligned: AlignedRecording) -> Candidate | None:
    """A constant of each coordinate as a competitor; None where one is fitted along in any case.

    It costs what an effect costs and names no cause: effects that act nearly as a constant are then judged by what
    they do beside it only where the recording needs it.
    """
    if aligned.registration_columns.shape[2]:
        return None
    effect = constant_effect(aligned)
    limits = np.tile([-np.inf, np.inf], (len(aligned.labels), 1))
    return Candidate(CONSTANT, effect, aligned.columns(effect, {}) * UM_PER_MM, limits, 0, kind="constant")


def constant_effect(aligned: AlignedRecording) -> Effect:
    """The constant as an effect, one number in um for each measured coordinate."""
    axes, of_links = list(aligned.axes), aligned.of_links
    if aligned.with_attitude:
        axes += [3, 4, 5]

    def columns(rows: Observations, constants: ConstantValues) -> FloatArray:
        size = rows.links if of_links else 6
        one_each = MM_PER_UM * np.eye(size)[:, axes]
        if not of_links:
            one_each[3:] /= MM_PER_RAD  # a urad of the attitude, which the port takes in rad
        return np.broadcast_to(one_each, (len(rows), size, len(axes)))

    return Effect(
        id=CONSTANT,
        ports=("link",) if of_links else ("reference",),
        physics="The same error in every row.",
        equation="delta = c",
        symbols={"c": "constant of each coordinate, um"},
        source="no cause: many effects make a constant",
        needs=(),
        parameters=tuple(
            Parameter(f"c_{name}", _parameter_unit(name), -math.inf, math.inf, "nothing is known of it")
            for name in aligned.label_names
        ),
        mistaken_for=(),
        separated_by="",
        basis=memoryless_basis(columns),
    )


def _parameter_unit(name: str) -> str:
    return ATTITUDE_UNIT if name in ATTITUDE_LABELS else "um"


def makes_only(columns: FloatArray, of: FloatArray) -> bool:
    """Whether columns (R, m, P) do nothing that others (R, m, Q) do not."""
    if not of.shape[2]:
        return False
    A = of.reshape(-1, of.shape[2])
    B = columns.reshape(len(A), -1)
    B = B / column_norms(B)
    outside = B - A @ solve_least_squares(A, B)
    return bool(((outside**2).sum(axis=0) <= MIN_OUTSIDE).all())


def split_constants(
    candidates: Sequence[Candidate], nuisance_um: FloatArray, rows: BoolArray
) -> tuple[tuple[Candidate, ...], tuple[Candidate, ...]]:
    """Candidates that can compete beside nuisance columns (N, m, Q), and those that make nothing else than these.

    Of the latter one variant of each effect: on the rows (N,) it is a constant, or what the model has already.
    """
    competing: list[Candidate] = []
    same: dict[str, Candidate] = {}
    for candidate in candidates:
        if makes_only(candidate.columns_um[rows], nuisance_um[rows]):
            same.setdefault(candidate.name, candidate)
        else:
            competing.append(candidate)
    return tuple(competing), tuple(same.values())
