"""Within which time a state ends after what caused it has ended: one table, for the page of states and for worlds.

Each time follows from rules of the product, which the row names. This module is no page: it has no function `page`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from enum import StrEnum
from typing import NamedTuple, Self

from compd.commissioning import line_budgets
from compd.configuration import Configuration
from compd.live.acquisition import motion_while_away, quantity_trust, reading_trust
from compd.live.acquisition.polled_gauge import MAX_REST_S
from compd.live.acquisition.polled_round import TIMES_COST
from compd.live.acquisition.reply_order import MIN_POLLS
from compd.setpoint_states import State

# A person has to look, however long that takes.
PERSON = math.inf
# Rounds until a reading counts: one that is under way, one whose answers are thrown away, one that counts.
_ROUNDS = 3
# Cycles until a setpoint says so: one that is under way, and the next.
_CYCLES = 2


class Cause(StrEnum):
    """What a state comes from. text : what has ended, or happened, for people."""

    text: str

    def __new__(cls, name: str, text: str) -> Self:
        cause = str.__new__(cls, name)
        cause._value_, cause.text = name, text
        return cause

    STARTED = "started", "the daemon was started, with a machine zero"
    NO_ZERO = "no_zero", "there is no machine zero"
    CORRECTION = "correction", "another correction is asked for"
    LIMIT = "limit", "a correction, a target or a bound was beyond its limit"
    BRIEF = "brief", "a gauge was not read for less than its `restart_s`"
    SILENT = "silent", "a gauge was silent for longer, on an open line"
    LINE = "line", "a line was lost"
    PAUSED = "paused", "the computer has paused"
    ALL_SCALES = "all_scales", "all scales were away for at least their `restart_s`"
    ACQUISITION = "acquisition", "the process that polls the gauges has ended"
    QUANTITY = "quantity", "a quantity was wrong, and shows again what it showed"
    WRONG = "wrong", "a length has jumped, or came back with another value or at zero"


# Seconds of one configuration, for these gauges, after a cause that has lasted for so long (s).
Time = Callable[[Configuration, Sequence[str], float], float]


class End(NamedTuple):
    """How the states of one cause end.

    rest, moving : time (s) after the end of the cause until setpoints are valid and as good as before, of a machine
        that stands all the while, and of one that moves; PERSON. rule : from what they follow, in `compd/live`.
    """

    cause: Cause
    states: tuple[State, ...]
    rest: Time
    moving: Time
    rule: str


def within_s(
    configuration: Configuration,
    cause: Cause,
    moving: bool = False,
    gauges: Sequence[str] = (),
    lasted_s: float = math.inf,
) -> float:
    """Time (s) after the end of a cause until setpoints are `ok` again, or slew there; PERSON.

    moving : whether the machine has moved at any time since the cause began. gauges : those that it concerns, by name;
    all where none is named. lasted_s : duration of the cause, s, on which the wait for a lost line depends.
    """
    end = next(end for end in ENDS if end.cause is cause)
    return (end.moving if moving else end.rest)(configuration, gauges, lasted_s)


def state_within_s(configuration: Configuration, state: State, moving: bool = False) -> list[float]:
    """Times (s) within which a state ends, one for each of its causes; PERSON."""
    return [within_s(configuration, end.cause, moving) for end in ENDS if state in end.states]


def cause_of_silence(configuration: Configuration, gauge: str, silent_s: float) -> Cause:
    """BRIEF where a gauge that was silent for so long (s) is read again before its device could have restarted."""
    gap_s = silent_s + _read_again_s(configuration, [gauge], silent_s)
    return Cause.BRIEF if gap_s < configuration.gauges[gauge].restart_s else Cause.SILENT


# --- parts of the times -----------------------------------------------------------------------------------------------


def _lines(configuration: Configuration, gauges: Sequence[str]) -> Iterable[str]:
    return sorted({options.line for name, options in configuration.gauges.items() if not gauges or name in gauges})


def _round_s(configuration: Configuration, line: str) -> float:
    """A round of polls with the usual turnaround; the line's timeout where drivers do not say what they move."""
    for budget in line_budgets(configuration):
        if budget.name == line and budget.known:
            return max(budget.usual_s, budget.line.poll_every_s)
    return configuration.lines[line].timeout_s


def _slowest(part: Callable[[Configuration, str], float], waits: bool = False) -> Time:
    """The longest of a time over the lines of the gauges, with the cycles that follow. waits : for a lost line."""

    def time_s(configuration: Configuration, gauges: Sequence[str], lasted_s: float) -> float:
        return _CYCLES / configuration.loop.rate_hz + max(
            part(configuration, line) + (_back_off_s(configuration, line, lasted_s) if waits else 0.0)
            for line in _lines(configuration, gauges)
        )

    return time_s


def _back_off_s(configuration: Configuration, line: str, lasted_s: float) -> float:
    """Waits double, so that the last one is no longer than those before it together, and the first."""
    first_s, longest_s = configuration.lines[line].back_off_s
    return min(longest_s, lasted_s + first_s)


def _rest_s(configuration: Configuration, line: str) -> float:
    """Longest rest of a gauge that does not answer, and makes those stale that share its line."""
    if sum(options.line == line for options in configuration.gauges.values()) == 1:
        return MAX_REST_S
    return TIMES_COST * max(2 * configuration.lines[line].timeout_s, configuration.loop.stale_after_s)


def _rounds(configuration: Configuration, line: str) -> float:
    """Rounds until a reading counts, s."""
    return _ROUNDS * _round_s(configuration, line)


def _in_vain_s(configuration: Configuration, line: str) -> float:
    """A poll under way in vain, and the silence after it; then rounds until a reading counts."""
    return 2 * configuration.lines[line].timeout_s + _rounds(configuration, line)


def _opened_s(configuration: Configuration, line: str) -> float:
    """Until a line that is new has shown how fast its replies are, and has two readings by which to tell a speed."""
    return (MIN_POLLS + 2) * (configuration.lines[line].timeout_s + _round_s(configuration, line))


_read_again_s = _slowest(_in_vain_s)
_brief_s = _slowest(lambda configuration, line: _in_vain_s(configuration, line) + reading_trust.WAIT_FOR_OTHERS_S)
_silent_s = _slowest(
    lambda configuration, line: (
        _rest_s(configuration, line) + _in_vain_s(configuration, line) + motion_while_away.WAIT_FOR_OTHERS_S
    )
)
_line_s = _slowest(
    lambda configuration, line: _opened_s(configuration, line) + motion_while_away.WAIT_FOR_OTHERS_S, waits=True
)
_rounds_s = _slowest(_rounds)
_paused_s = _slowest(
    lambda configuration, line: (
        configuration.lines[line].timeout_s + _rounds(configuration, line) + reading_trust.WAIT_FOR_OTHERS_S
    )
)
_polled_anew_s = _slowest(_opened_s)
_started_s = _slowest(
    lambda configuration, line: (
        _opened_s(configuration, line) + max(quantity_trust.MAX_START_S, motion_while_away.WAIT_FOR_OTHERS_S)
    )
)
_quantity_s = _slowest(lambda configuration, line: 2 * quantity_trust.LASTING_S + _in_vain_s(configuration, line))


def _slewing_s(configuration: Configuration, gauges: Sequence[str], lasted_s: float) -> float:
    """From one limit of the correction to the other."""
    return 2 * configuration.limits.correction_mm / configuration.limits.slew_mm_per_s


def _person(configuration: Configuration, gauges: Sequence[str], lasted_s: float) -> float:
    return PERSON


_LOST = (State.HOLD, State.FADE, State.DEGRADED, State.STOP, State.REFUSED)

ENDS = (
    End(
        Cause.STARTED,
        (State.STARTING, State.STOP, State.REFUSED),
        _started_s,
        _person,
        f"a new line, then {motion_while_away.WAIT_FOR_OTHERS_S:g} s for the other gauges (`motion_while_away.py`) or "
        f"{quantity_trust.MAX_START_S:g} s for quantities (`quantity_trust.py`)",
    ),
    End(Cause.NO_ZERO, (State.NO_ZERO,), _person, _person, "`compd zero`, at machine zero"),
    End(
        Cause.CORRECTION,
        (State.SLEWING,),
        _slewing_s,
        _slewing_s,
        "2 `limits.correction_mm` / `limits.slew_mm_per_s` (`limits.py`)",
    ),
    End(
        Cause.LIMIT,
        (State.CLAMPED, State.REFUSED),
        _rounds_s,
        _rounds_s,
        f"{_ROUNDS} rounds of the slowest line, and {_CYCLES} cycles (`cycle.py`)",
    ),
    End(
        Cause.BRIEF,
        _LOST,
        _brief_s,
        _brief_s,
        f"2 `timeout_s` of the line, {_ROUNDS} rounds, and {reading_trust.WAIT_FOR_OTHERS_S:g} s for what other links "
        "say (`reading_trust.py`)",
    ),
    End(
        Cause.SILENT,
        _LOST,
        _silent_s,
        _person,
        f"a rest of {MAX_REST_S:g} s (`polled_gauge.py`; {TIMES_COST} times its cost where gauges share the line, "
        f"`polled_round.py`), 2 `timeout_s`, {_ROUNDS} rounds, and "
        f"{motion_while_away.WAIT_FOR_OTHERS_S:g} s for the other gauges (`motion_while_away.py`)",
    ),
    End(
        Cause.LINE,
        _LOST,
        _line_s,
        _person,
        "`back_off_s`, at most the first and the time for which it was lost, a new line, and "
        f"{motion_while_away.WAIT_FOR_OTHERS_S:g} s for the other gauges",
    ),
    End(
        Cause.PAUSED,
        _LOST,
        _paused_s,
        _paused_s,
        f"`timeout_s` of the line, for the silence after a missed reply (`polled_round.py`), {_ROUNDS} rounds, and "
        f"{reading_trust.WAIT_FOR_OTHERS_S:g} s for what other links say (`reading_trust.py`)",
    ),
    End(
        Cause.ALL_SCALES,
        (State.STOP, State.REFUSED, State.FAULT),
        _person,
        _person,
        "`compd accept`: nothing says whether the machine has moved (`motion_while_away.py`)",
    ),
    End(
        Cause.ACQUISITION,
        _LOST,
        _polled_anew_s,
        _polled_anew_s,
        f"a new line: {MIN_POLLS + 2} rounds, each with `timeout_s` (`reply_order.py`); the process starts at once, "
        "and later where it ends again (`heartbeat.py`)",
    ),
    End(
        Cause.QUANTITY,
        (*_LOST, State.FAULT),
        _quantity_s,
        _quantity_s,
        f"2 x {quantity_trust.LASTING_S:g} s (`quantity_trust.py`), where an effect reads it",
    ),
    End(Cause.WRONG, (State.FAULT,), _person, _person, "`compd accept` (`reading_trust.py`)"),
)
