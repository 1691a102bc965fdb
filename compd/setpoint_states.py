"""The states and modes of a setpoint: one row for each, used by packet, JSON, `compd watch` and the reference.

To add a state, append a row and return it where it arises (cycle.py, stale_policy.py or limits.py). Names and codes
are part of the protocol: they never change and are never used again. A reader that meets a name or a code which it
does not know must take the setpoint for invalid.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Self

_LOST = "a comparator is lost, or the daemon is about to end; "
_BEYOND = "beyond a limit with `on_limit: refuse`, "
_BACK = "by itself, when every gauge is good again: the correction slews there"
_LATER = "by itself, with the next pose, target or reading that can be used"


class State(StrEnum):
    """How a setpoint came about.

    code : number of the state in the UDP packet.
    valid : whether a setpoint in this state has values that a controller may use.
    rank : where several states apply to one cycle, the one of the highest rank is reported.
    text : meaning, for people.
    left : how it is left.
    """

    code: int
    valid: bool
    rank: int
    text: str
    left: str

    def __new__(cls, name: str, code: int, valid: bool, rank: int, text: str, left: str) -> Self:
        state = str.__new__(cls, name)
        state._value_ = name
        state.code, state.valid, state.rank, state.text, state.left = code, valid, rank, text, left
        return state

    # fmt: off
    # name in the JSON, code, valid, rank, text, left
    STARTING = "starting", 0, False, 4, "not every gauge has been read yet", "when every gauge has been good once"
    NO_ZERO = "no_zero", 1, False, 4, "no machine zero fits this configuration", "`compd zero`"
    OK = "ok", 2, True, 0, "every gauge is good, and the correction is the one that they ask for", "when that changes"
    SLEWING = (
        "slewing", 3, True, 1, "the correction is under way at `limits.slew_mm_per_s`; it never jumps",
        "when it has arrived",
    )
    CLAMPED = (
        "clamped", 4, True, 3, "a link's correction is at its limit, `limits.correction_mm`, or an effect at the edge "
        "of the range in which it was fitted", "when the gauges ask for less, or the model is fitted again",
    )
    HOLD = "hold", 5, True, 2, _LOST + "the last good set of them is used, at most `loop.hold_s`", _BACK
    FADE = "fade", 6, True, 2, _LOST + "the last good set is taken back to zero over `loop.hold_s`", _BACK
    STOP = (
        "stop", 7, False, 4, "a gauge is lost without a substitute, the loop makes no setpoints, or the daemon ends",
        _BACK,
    )
    REFUSED = (
        "refused", 8, False, 4, _BEYOND + "out of reach, not finite, of lengths that were measured further apart than "
        "`loop.skew_s`, or of a tip that may be further off than `limits.tip_error_um`", _LATER,
    )
    DEGRADED = (
        "degraded", 9, True, 2, "a correction that `reason` names is absent; `u_tip_um` says what that costs", _BACK,
    )
    FAULT = (
        "fault", 10, False, 4, "a gauge is not believed any more: it jumped, came back with another value, or others "
        "contradict it", "never by itself: a person looks at the gauge, then `compd accept`",
    )
    # fmt: on


def state_named(name: str) -> State | None:
    """The state of that name; None where this release does not know it: the setpoint is then invalid."""
    return next((state for state in State if state == name), None)


class Mode(StrEnum):
    """What determines the tip. code : number of the mode in the UDP packet. text : meaning, for people."""

    code: int
    text: str

    def __new__(cls, name: str, code: int, text: str) -> Self:
        mode = str.__new__(cls, name)
        mode._value_ = name
        mode.code, mode.text = code, text
        return mode

    CMM = "cmm", 0, "the scales, as they are read, say where the tip is"
    MACHINE_TOOL = "machine_tool", 1, "a controller's `TARGET` says where the tip is to be"
