"""What a thermal cause rests on: how often what drives it went up and down, and in how many sessions.

All that warms up in a session rises together, and with time; one warm-up is one event, of which every thermometer tells
the same. A second session, or a second time up after a time down, can contradict a cause. One warm-up cannot.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from compd.arrays import BoolArray, FloatArray
from compd.comparison import AlignedRecording
from compd.diagnosis.criteria import Criteria
from compd.model.effects import Effect, needed_quantities


def is_thermal(effect: Effect) -> bool:
    """Whether a temperature drives the effect."""
    return any(need.startswith("temperature") for need in effect.needs)


def seen_once(aligned: AlignedRecording, used: BoolArray, effects: Iterable[Effect], criteria: Criteria) -> list[str]:
    """Ids of the thermal effects that one session shows, in less than a second cycle of heating and cooling.

    used : (N,) rows that count.
    """
    session = aligned.recording.session
    if session is not None and len(np.unique(session[used & (session >= 0)])) > 1:
        return []
    quantities, links = aligned.rows.quantities, aligned.rows.links

    def cycles(effect: Effect) -> bool:
        names = [name for name in needed_quantities(effect, links) if name.startswith("temperature")]
        return has_cycled([quantities[name][used] for name in names if name in quantities], criteria.swing_share)

    return [effect.id for effect in effects if is_thermal(effect) and not cycles(effect)]


def has_cycled(temperatures: Sequence[FloatArray], share: float) -> bool:
    """Whether one of some temperatures goes up and down, and the first way again.

    temperatures : (R,) each, in order. One that moves by less than a share of what another moves shows its noise alone.
    """
    known = [values[np.isfinite(values)] for values in temperatures]
    ranges = [float(np.ptp(values)) if len(values) else 0.0 for values in known]
    moving = [values for values, moved in zip(known, ranges, strict=True) if moved >= share * max(ranges)]
    return any(swings(values, share) > 2 for values in moving)


def swings(values: FloatArray, share: float) -> int:
    """How often values (R,) in order go up or down by a share of their whole range before they turn.

    >>> swings(np.array([20.0, 25.0, 30.0]), 0.3), swings(np.array([20.0, 30.0, 20.5, 29.0]), 0.3)
    (1, 3)
    """
    if not len(values) or (least := share * float(np.ptp(values))) == 0:
        return 0
    count, way = 0, 0
    low = high = turn = float(values[0])
    for value in values.tolist():
        low, high = min(low, value), max(high, value)
        if way == 0 and high - low >= least:
            count, way, turn = 1, 1 if value == high else -1, value
        elif way * (value - turn) > 0:
            turn = value
        elif way * (turn - value) >= least:
            count, way, turn = count + 1, -way, value
    return count
