"""The page of the states of a setpoint."""

from __future__ import annotations

import math
from collections.abc import Sequence

from compd.configuration import load_machine
from compd.setpoint_states import State
from docs.generate.markdown import heading, join, table
from docs.generate.state_ends import ENDS, PERSON, state_within_s, within_s

INTRODUCTION = """\
`code` is the number in the UDP packet. A reader that meets a state or a code that it does not know must
treat the setpoint as invalid, because later releases may add some. *Ends within* counts from the end of what caused
the state, and holds for the tripod that comes with compd: [by cause](#states-ends).
"""
BY_CAUSE = """\
The times of the shipped tripod, with all its gauges. They follow from the keys and constants in the last column, where
file names are those of `compd/live`. *Moved* is a machine that has moved since the cause began. The wait for a lost
line of a network, up to 10 s, is shorter where it was lost for a shorter time.
"""


def page() -> str:
    """Markdown, from the table of states and that of their ends."""
    configuration = load_machine("tripod-cmm")
    states = [
        [
            f"`{state}`",
            f"{state.code}, {'valid' if state.valid else 'invalid'}: {state.text}",
            state.left,
            _ends(state_within_s(configuration, state), state_within_s(configuration, state, moving=True)),
        ]
        for state in State
    ]
    causes = [
        [
            end.cause.text,
            ", ".join(f"`{state}`" for state in end.states),
            _ends([within_s(configuration, end.cause)], [within_s(configuration, end.cause, moving=True)]),
            end.rule,
        ]
        for end in ENDS
    ]
    return join(
        "# States of a setpoint",
        INTRODUCTION,
        table(["state", "code and meaning", "how it is left", "ends within"], states),
        heading(2, "When a state ends", "states-ends"),
        BY_CAUSE,
        table(["what has ended", "states", "ends within", "follows from"], causes),
    )


def _ends(rest_s: Sequence[float], moving_s: Sequence[float]) -> str:
    """A cell: times of a machine at rest, and of one that has moved where they differ."""
    rest, moving = _span(rest_s), _span(moving_s)
    return (rest if rest == moving else f"{rest}; moved: {moving}") or "-"


def _span(times_s: Sequence[float]) -> str:
    finite = sorted({time_s for time_s in times_s if math.isfinite(time_s)})
    shown = " to ".join(dict.fromkeys(_seconds(time_s) for time_s in (finite[0], finite[-1]))) if finite else ""
    person = _seconds(PERSON) if PERSON in times_s else ""
    return ", or ".join(filter(None, (shown, person)))


def _seconds(time_s: float) -> str:
    return f"{time_s:.2g} s" if math.isfinite(time_s) else "a person"
