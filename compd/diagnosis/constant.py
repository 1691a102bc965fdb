"""A constant of the measured coordinates: no effect's signature, and part of what many effects do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.least_squares import column_norms, solve_least_squares
from compd.diagnosis.candidates import Candidate
from compd.diagnosis.findings import ConstantFinding
from compd.diagnosis.rivals import find_rivals
from compd.model.effect import ConstantValues, Effect, FittedEffect, Parameter, memoryless_basis
from compd.model.observations import Observations
from compd.units import UM_PER_MM

if TYPE_CHECKING:
    from compd.diagnosis.explanation import Explanation
    from compd.diagnosis.problem import DiagnosisProblem

CONSTANT = "constant"
MM_PER_UM = 1 / UM_PER_MM
# Columns of which less than this share of the squares lies outside a subspace are part of it: rounding of the forward
# model, which is linear within 1e-5.
LEAST_OUTSIDE = 1e-4


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

    def columns(rows: Observations, constants: ConstantValues) -> FloatArray:
        size = rows.links if of_links else 6
        return np.broadcast_to(MM_PER_UM * np.eye(size)[:, axes], (len(rows), size, len(axes)))

    return Effect(
        id=CONSTANT,
        ports=("link",) if of_links else ("reference",),
        physics="The same error in every row.",
        equation="delta = c",
        symbols={"c": "constant of each coordinate, um"},
        source="no cause: many effects make a constant",
        needs=(),
        parameters=tuple(
            Parameter(f"c_{name}", "um", -math.inf, math.inf, "nothing is known of it") for name in aligned.label_names
        ),
        mistaken_for=(),
        separated_by="",
        basis=memoryless_basis(columns),
    )


def makes_only(columns: FloatArray, of: FloatArray) -> bool:
    """Whether columns (R, m, P) do nothing that others (R, m, Q) do not."""
    if not of.shape[2]:
        return False
    A = of.reshape(-1, of.shape[2])
    B = columns.reshape(len(A), -1)
    B = B / column_norms(B)
    outside = B - A @ solve_least_squares(A, B)
    return bool(((outside**2).sum(axis=0) <= LEAST_OUTSIDE).all())


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


def name_constant(explanation: Explanation) -> Explanation:
    """Where nothing but a constant was found, the effect that makes it best in its place, with its rivals.

    Beside effects that vary a constant is told on a line of its own; alone, it is what is wrong with the machine.
    """
    if len(explanation.members) != 1 or not explanation.constants:
        return explanation
    family = find_rivals(explanation.losses, explanation.members, explanation.constants[0])
    return replace(explanation, members=(family[0].member,)) if family else explanation


def describe_constant(
    problem: DiagnosisProblem, explanation: Explanation, named: Mapping[int, FittedEffect], constant_um: FloatArray
) -> ConstantFinding | None:
    """The constant that was taken off or found, and the effects that it may come from; None where there is none.

    named : the fitted effect of each named member.  constant_um : (m,) what was taken off beside these: the mean of
    what an effect does is the effect's.
    """
    aligned, losses = problem.aligned, explanation.losses
    if explanation.constants:
        member = explanation.constants[0]
        values, std = named[member].theta, np.sqrt(np.diag(named[member].covariance))
        rivals = find_rivals(losses, explanation.members, member)
        effects = [losses.candidates[rival.member].effect for rival in rivals]
    elif aligned.registration_columns.shape[2] and not aligned.registered:
        values, std = constant_um, np.full(len(aligned.labels), np.nan)
        effects = [candidate.effect for candidate in problem.same_as_nuisance]
    else:
        return None
    return ConstantFinding(
        by_axis_um=dict(zip(aligned.labels, values.tolist(), strict=True)),
        std_um=dict(zip(aligned.labels, std.tolist(), strict=True)),
        effects=tuple(effect.id for effect in effects),
        separated_by=effects[0].separated_by if effects else "",
    )
