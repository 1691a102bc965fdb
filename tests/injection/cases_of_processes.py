"""Lost processes and hostile clients."""

from __future__ import annotations

from tests.injection import clients
from tests.injection.beginnings import (
    killed,
    stalled,
)
from tests.injection.case import Case, Way

PROCESSES = "Processes"
CLIENTS = "Clients"
KILL, STOP = "SIGKILL", "SIGSTOP"

PROCESSES_AND_CLIENTS: tuple[Case, ...] = (
    # --- processes
    *(
        Case(
            f"{process}-{signal.lower()}",
            PROCESSES,
            f"the process `{process}` {'is killed' if signal == KILL else 'hangs'}",
            signal,
            killed(process) if signal == KILL else stalled(process),
            Way.ITSELF,
            watched_s=1.0,
            lost=process in ("service", "supervisor"),
            real=signal == KILL and process in ("loop", "service"),
        )
        for process, signal in (
            ("loop", KILL),
            ("loop", STOP),
            ("acquisition", KILL),
            ("acquisition", STOP),
            ("service", KILL),
            ("supervisor", KILL),
        )
    ),
    Case(
        "daemon-stopped",
        PROCESSES,
        "the whole daemon is stopped and goes on",
        "SIGSTOP, 1 s later SIGCONT",
        stalled(s=1.0),
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
        Case(
            f"client-{name}",
            CLIENTS,
            what,
            injected,
            clients.attack(name),
            Way.UNDISTURBED,
            real=True,
            virtual=False,
        )
        for name, (what, injected) in clients.ATTACKS.items()
    ),
)
