"""What one row of the fault matrix says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from compd.setpoint_states import State
from tests.injection.machine import Machine

# At rest without a fault the largest error of thousands of valid setpoints is 0.3 um: gauge noise.
PUBLISHED_UM = 1.0
# Setpoints are invalid: a scale has no substitute. And where the last good set of comparators may stand in.
INVALID = frozenset({State.STOP, State.FAULT})
SUBSTITUTED = frozenset({State.HOLD, State.STOP, State.FAULT})

Begin = Callable[[Machine], None]


class Way(Enum):
    """How the daemon comes out of a fault once its cause has gone. The value is for people."""

    UNDISTURBED = "nothing to leave: the setpoints stay `ok`"
    ITSELF = "by itself"
    ACCEPTED = "by `compd accept`"
    EITHER = "by itself, or by `compd accept` where a gauge is not believed any more"
    UNSEEN = "nothing shows it"


@dataclass(frozen=True)
class Case:
    """One row of the matrix.

    group : heading on the page. fault : what fails, in a user's words. injected : what the injector does. begin :
    does it. must : what must happen. states : one of these must be seen. names : part of a reason that is then
    given, or may be where nothing must show. bound_um : of the error of any valid setpoint, from the beginning
    until the state is ok again. way : out of it. at_least_um : of what nothing shows, the error that it makes.
    watched_s : how long the fault lasts. lost : whether the daemon itself ends and the service manager starts it
    again. real : it is tried with real ptys, sockets and processes, too.
    virtual : it is tried in virtual time. unseen : the blind spot (`compd check --what-cannot-be-seen`) of what
    nothing shows, or not at once. drives : it drives the machine itself. expands : it needs a machine that expands.
    """

    id: str
    group: str
    fault: str
    injected: str
    begin: Begin
    way: Way
    states: frozenset[State] = frozenset()
    names: str = ""
    bound_um: float = PUBLISHED_UM
    at_least_um: float = 0.0
    watched_s: float = 1.5
    lost: bool = False
    real: bool = False
    virtual: bool = True
    unseen: str = ""
    drives: bool = False
    expands: bool = False
