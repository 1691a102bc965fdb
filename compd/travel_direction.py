"""Direction of travel of a link: one rule for recordings, for the running daemon and for effects with friction.

A link reverses when its scale has come back by more than `REVERSAL_MM` from the farthest position that it reached in
its present direction. Noise below that is no movement, and slow creep counts once it has added up.

>>> directions, last = follow([0.0, 1.5e-3, 2.3e-3, 1.4e-3, 1.2e-3])
>>> directions
[0.0, 1.0, 1.0, 1.0, -1.0]
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray

# A scale's noise is some 10 nm, a backlash that matters 0.1 um or more.
REVERSAL_MM = 1e-3


class Travel(NamedTuple):
    """State of one link.

    turning_mm : the farthest position in the present direction, from which a reversal is measured; nan before the
        first reading.
    direction : +1.0 while the scale's reading grows, -1.0 while it shrinks, 0.0 until the link has moved.
    """

    turning_mm: float = math.nan
    direction: float = 0.0


_UNMOVED = Travel()


def advance(travel: Travel, position_mm: float) -> Travel:
    """The state after one more reading of the scale, in mm. A reading that is nan changes nothing."""
    turning_mm, direction = travel
    if math.isnan(turning_mm):
        return Travel(position_mm, direction)
    since_mm = position_mm - turning_mm
    if abs(since_mm) > REVERSAL_MM:
        return Travel(position_mm, math.copysign(1.0, since_mm))
    # the farthest position moves on with the link, and stays while the link comes back by less
    return Travel(position_mm, direction) if since_mm * direction > 0.0 else travel


def follow(positions_mm: Iterable[float], travel: Travel = _UNMOVED) -> tuple[list[float], Travel]:
    """The direction after each of a link's positions, in the order of time, and the last state.

    travel : the state before the first. The rule is that of `advance`, without a state for each of millions of rows.
    """
    turning_mm, direction = travel
    directions = []
    for position_mm in positions_mm:
        since_mm = position_mm - turning_mm
        if since_mm > REVERSAL_MM:
            turning_mm, direction = position_mm, 1.0
        elif since_mm < -REVERSAL_MM:
            turning_mm, direction = position_mm, -1.0
        elif since_mm * direction > 0.0 or math.isnan(turning_mm):
            turning_mm = position_mm
        directions.append(direction)
    return directions, Travel(turning_mm, direction)


class RowDirections:
    """Direction of travel of each link in every row of a recording, also where its rows come block by block.

    What happened between two rows is not known: a link that went out and came back looks as if it stood still. Where
    that matters, record the `approach` columns.
    """

    def __init__(self) -> None:
        self._travels: list[Travel] = []
        self._session: int | None = None

    def of_block(self, scale_mm: FloatArray, session: IntArray | None) -> FloatArray:
        """The directions in the rows that follow those of the last call.

        Parameters
        ----------
        scale_mm : (N, n), nan where there is no value.
        session : (N,) or None. Every session begins anew.

        Returns
        -------
        (N, n) +1 or -1; nan before a link's first movement in a session.
        """
        rows, links = scale_mm.shape
        direction = np.zeros(scale_mm.shape)
        begins = [0] if session is None else [0, *(np.flatnonzero(np.diff(session)) + 1).tolist()]
        for begin, end in pairwise([*begins, rows] if rows else []):
            session_number = None if session is None else int(session[begin])
            if not self._travels or session_number != self._session:
                self._travels, self._session = [_UNMOVED] * links, session_number
            for link in range(links):
                positions_mm = scale_mm[begin:end, link].tolist()
                direction[begin:end, link], self._travels[link] = follow(positions_mm, self._travels[link])
        direction[direction == 0.0] = np.nan
        return direction


def row_directions(scale_mm: FloatArray, session: IntArray | None) -> FloatArray:
    """Direction of travel of each link in every row of a whole recording: arguments and result of `RowDirections`."""
    return RowDirections().of_block(scale_mm, session)
