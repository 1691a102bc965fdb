"""Lost processes and hostile clients."""

from __future__ import annotations

import signal

from tests.injection import clients
from tests.injection.beginnings import (
    sent,
    stalled,
    stopped,
)
from tests.injection.case import Case, Way

PROCESSES = "Processes"
CLIENTS = "Clients"

PROCESSES_AND_CLIENTS: tuple[Case, ...] = (
    # --- processes
    *(
        Case(
            f"{process}-{number.name.lower()}",
            PROCESSES,
            f"the process `{process}` {verb}",
            f"{number.name}",
            sent(process, number),
            Way.ITSELF,
            watched_s=1.0,
            lost=process in ("service", "supervisor"),
            sample=process == "loop" and number is signal.SIGKILL,
        )
        for process, number, verb in (
            ("loop", signal.SIGKILL, "is killed"),
            ("loop", signal.SIGSTOP, "hangs"),
            ("acquisition", signal.SIGKILL, "is killed"),
            ("acquisition", signal.SIGSTOP, "hangs"),
            ("service", signal.SIGKILL, "is killed"),
            ("supervisor", signal.SIGKILL, "is killed"),
        )
    ),
    Case(
        "daemon-stopped",
        PROCESSES,
        "the whole daemon is stopped and goes on",
        "SIGSTOP, 1 s later SIGCONT",
        stopped,
        Way.ITSELF,
        watched_s=1.0,
    ),
    Case(
        "acquisition-stalls",
        PROCESSES,
        "the process `acquisition` stalls for less than its guard's patience",
        "SIGSTOP, 0.4 s later SIGCONT",
        stalled("acquisition", 0.4),
        Way.ITSELF,
        watched_s=1.0,
    ),
    # --- clients
    *(
        Case(f"client-{name}", CLIENTS, what, injected, clients.attack(name), Way.UNDISTURBED, sample=name == "status")
        for name, (what, injected) in clients.ATTACKS.items()
    ),
)
