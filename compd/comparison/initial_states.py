"""States that nobody knows when a session begins: how warm a rod already was behind the skin that a thermometer sees.

An effect with a lag computes y from x, tau dy/dt = x - y, and starts each session in equilibrium, y = x. A machine that
had been warming up was not: what is missing then, (y0 - x0) exp(-t / tau) at each link in each session, is no error of
the effect. It is linear in y0 - x0, and fitted along as the frame of an instrument is. The columns are differences: the
effect with one state of its memory (`Effect.unknown_states`) greater by 1 in the first row of one session, less the
effect without.

Example: on a tripod with four sessions link_expansion_lag has twelve unknown states::

    initial_state_columns(aligned, library["link_expansion_lag"], {"tau": 900.0}).shape  # (N, 3, 12)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.model.effects import ConstantValues, Effect, Observations, evaluate_basis
from compd.units import UM_PER_MM


def initial_state_columns(aligned: AlignedRecording, effect: Effect, constants: ConstantValues) -> FloatArray:
    """(N, m, Q) by how many um each unknown state at the start of each session moves the prediction, per unit of it.

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
