"""Nuisance terms: what is fitted along with every model, because a recording cannot show it and no effect is to blame.

They are where an instrument's frame lies, or the constant of each coordinate of an external model (`registration`), and
the states that nobody knew when a session began, of the model's effects with memory (`initial_states`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.model.effects import ConstantValues, Effect, FittedEffect, Observations, evaluate_basis
from compd.statistics import column_norms, robust_regression, solve_least_squares
from compd.units import UM_PER_MM


def initial_state_columns(aligned: AlignedRecording, effect: Effect, constants: ConstantValues) -> FloatArray:
    """States unknown when a session begins: how warm a rod already was behind the skin that a thermometer sees.

    An effect with a lag computes y from x, tau dy/dt = x - y, and starts each session in equilibrium, y = x. A machine
    that had been warming up was not: what is missing then, (y0 - x0) exp(-t / tau) at each link in each session, is no
    error of the effect. It is linear in y0 - x0, and fitted along as the frame of an instrument is. The columns are
    differences: the effect with one state of its memory (`Effect.unknown_states`) greater by 1 in the first row of one
    session, less the effect without.

    Example: on a tripod with four sessions link_expansion_lag has twelve unknown states::

        initial_state_columns(aligned, library["link_expansion_lag"], {"tau": 900.0}).shape  # (N, 3, 12)

    (N, m, Q) by how many um each unknown state at the start of each session moves the prediction, per unit of it.

    The Q states are those of the first session, then of the next; a state moves only the rows of its own session. None,
    Q = 0, for an effect without unknown states.
    """
    rows = aligned.rows
    sessions = _sessions(rows) if effect.unknown_states else ()
    columns = [column for session in sessions for column in _session_columns(effect, constants, rows, session)]
    if not columns:
        return np.zeros((*aligned.measured_mm.shape, 0))
    return aligned.propagated(effect, np.stack(columns, axis=2)) * UM_PER_MM


def _sessions(rows: Observations) -> Iterator[IntArray]:
    """The rows of each session."""
    yield from np.split(np.arange(len(rows)), np.flatnonzero(rows.session_start[1:]) + 1)


def _session_columns(
    effect: Effect, constants: ConstantValues, rows: Observations, session: IntArray
) -> Iterator[FloatArray]:
    """(N, sum of port sizes) each: what a state at the start of one session adds for 1 of each fitted number, mm.

    The session begins with the first row in which the effect is known. States that move nothing are left out.
    """
    basis, _ = evaluate_basis(effect, rows.select(session), constants, None)
    known = np.isfinite(basis).all(axis=(1, 2))
    if not known.any():
        return
    session = session[int(np.argmax(known)) :]
    _, memory = evaluate_basis(effect, rows.select(session[:1]), constants, None)
    assert memory is not None
    later = replace(rows.select(session), session_start=np.zeros(len(session), dtype=bool))
    without, _ = evaluate_basis(effect, later, constants, memory)
    for place in effect.unknown_states:
        for state in range(len(memory[place])):
            greater = [array.copy() for array in memory]
            greater[place][state] += 1.0
            moved = evaluate_basis(effect, later, constants, tuple(greater))[0] - without
            for number in np.flatnonzero((np.nan_to_num(moved) != 0).any(axis=(0, 1))):
                column = np.zeros((len(rows), moved.shape[1]))
                column[session] = moved[:, :, number]
                yield column


# What is fitted along is an effect's own where the effect leaves less of it than this share.
MIN_SHARE = 1e-4
# Rounds in which the weights of lengths and attitudes settle.
SCATTER_ROUNDS = 4


class FittedAlong(NamedTuple):
    """(N, m) what nuisance terms explain of a residual, um.

    registration_um : the instrument's frame, or a constant.  states_um : unknown states at the start of sessions.
    """

    registration_um: FloatArray
    states_um: FloatArray

    @property
    def total_um(self) -> FloatArray:
        """Both together."""
        return self.registration_um + self.states_um


def nuisance_columns(aligned: AlignedRecording, effects: Sequence[FittedEffect]) -> FloatArray:
    """(N, m, Q) by how many um each nuisance term moves the prediction: of the registration, then of the states."""
    states = [initial_state_columns(aligned, effect.effect, effect.constants) for effect in effects]
    return np.concatenate([aligned.registration_columns * UM_PER_MM, *states], axis=2)


def nuisance_beside(
    aligned: AlignedRecording, effects: Sequence[FittedEffect], own_um: FloatArray, use: BoolArray
) -> FloatArray:
    """(N, m, Q) nuisance columns in um without what the effects' own columns (N, m, P) make of them on the rows `use`.

    An effect of the model that is nothing but a constant takes the constant; else the two would share it.
    """
    columns_um = nuisance_columns(aligned, effects)
    if not columns_um.shape[2] or not own_um.shape[2] or not use.any():
        return columns_um
    A = own_um[use].reshape(-1, own_um.shape[2])
    R = columns_um[use].reshape(len(A), -1)
    norms = column_norms(R)
    R = R / norms
    _, sizes, combinations = np.linalg.svd(R - A @ solve_least_squares(A, R), full_matrices=False)
    return np.asarray((columns_um / norms) @ combinations[sizes > MIN_SHARE].T)


def fit_along(
    aligned: AlignedRecording, effects: Sequence[FittedEffect], residual_um: FloatArray, use: BoolArray
) -> FittedAlong:
    """What the nuisance terms explain of a residual (N, m), fitted to the rows `use` (N,) by robust regression.

    Zeros without any term, and where no row is left.
    """
    G = nuisance_columns(aligned, effects)
    if not G.shape[2]:
        none = np.zeros_like(residual_um)
        return FittedAlong(none, none)
    theta = _fitted_parameters(aligned, G, residual_um, use)
    count = aligned.registration_columns.shape[2]
    return FittedAlong(G[:, :, :count] @ theta[:count], G[:, :, count:] @ theta[count:])


def _fitted_parameters(aligned: AlignedRecording, G: FloatArray, residual_um: FloatArray, use: BoolArray) -> FloatArray:
    """(Q,) of the columns G (N, m, Q)."""
    if not G.shape[2] or not use.any():
        return np.zeros(G.shape[2])
    rows, residual_um, size_um = G[use], residual_um[use], np.ones(1)
    theta = np.zeros(G.shape[2])
    # urad and um have no size in common: each unit counts in the scatter that the fit leaves, not in what it takes away
    for _ in range(SCATTER_ROUNDS if aligned.with_attitude else 1):
        if aligned.with_attitude:
            size_um = aligned.scatter_by_unit(residual_um - rows @ theta)
        theta = robust_regression(rows / size_um[:, None], residual_um / size_um, huber=aligned.criteria.huber_sigmas)
    return theta
