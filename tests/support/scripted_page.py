"""The page's server without a daemon: what the daemon is said to tell is set by a test, in a thread of its own."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args
from urllib.parse import quote

import uvicorn

from compd.page import Token, hashed
from compd.page.daemon_link import DaemonLink
from compd.page.guard import Guard, Role
from compd.page.recordings import Recordings
from compd.page.server import Server
from compd.setpoint_states import State

LOOKS, ORDERS = get_args(Role)
TOKENS: dict[Role, str] = {LOOKS: "a viewer's", ORDERS: "an operator's"}
LINKS = (1, 2, 3)
MACHINE = {
    "class": "MACHINE",
    "machine": "scripted",
    "geometry": {"kinematics": "tripod_3spr", "plate_points_M_mm": [[-300, 175, 0], [0, -350, 0], [300, 175, 0]]},
    "limits": {"correction_mm": 0.2, "slew_mm_per_s": 0.5},
    "wiring": [
        {"kind": "scale", "link": link, "channel": f"scale_{link}.position", "sign": 1, "stale_after_s": 0.5}
        for link in LINKS
    ],
}
COLUMNS = [{"channel": wire["channel"], "sign": 1, "stale_after_s": 0.5} for wire in MACHINE["wiring"]]  # type: ignore[index]
BUDGET = {"tip_um": {"joints": [1.0, 2.0, 3.0], "frame": [0.5, -0.5, 0.5]}}
TIP_MM = [12.3456, -7.8901, 190.1234]


class ScriptedLink(DaemonLink):
    """A link to no daemon."""

    async def run(self) -> None:
        """Nothing comes but what is set."""
        await asyncio.Event().wait()

    def tell(self, state: State, reason: str, time_s: float = 100.0) -> None:
        """The daemon is there, and its setpoint is in this state."""
        setpoint: dict[str, Any] = {"state": state.value, "valid": state.valid, "reason": reason, "mode": "cmm"}
        if state.valid:
            setpoint |= {"age_s": 0.02, "tip_M_mm": TIP_MM, "u_tip_um": 0.6}
            setpoint |= {"correction_mm": [0.011, -0.012, 0.013]}
            setpoint |= {"sources_mm": {"joints": [0.01, -0.01, 0.01], "frame": [0.001, -0.002, 0.003]}}
        readings = {column["channel"]: {"value": 1.0, "time_s": time_s - 0.02} for column in COLUMNS}
        zero = {"readings_mm": dict.fromkeys(readings, 0.5)}
        self.machine, self.columns, self.budget = MACHINE, COLUMNS, BUDGET
        self.readings = {"time_s": time_s, "readings": readings, "zero": zero, "setpoint": setpoint}
        self.connected, self.reason = True, ""

    def gone(self, reason: str) -> None:
        """No daemon, but what it told last is still here: nobody may show it."""
        self.connected, self.reason = False, reason


@dataclass
class ScriptedPage:
    """A page that is served. address, viewer : with a token that may give orders, or only look. recordings : their
    directory."""

    address: str
    viewer: str
    link: ScriptedLink
    recordings: Path


@contextmanager
def scripted(recordings: Path) -> Iterator[ScriptedPage]:
    """A page whose link tells `ok`, until a test has it tell something else."""
    link = ScriptedLink("/no/socket")
    link.tell(State.OK, "")
    listener = socket.create_server(("127.0.0.1", 0))
    host = f"127.0.0.1:{listener.getsockname()[1]}"
    server = Server(link, Recordings(recordings, "/no/socket"))
    tokens = [Token(f"who {role}s", role, hashed(token)) for role, token in TOKENS.items()]
    guarded = Guard(server.app(), tokens, [f"http://{host}"], listener.getsockname()[1])
    running = uvicorn.Server(uvicorn.Config(guarded, log_config=None, access_log=False, timeout_graceful_shutdown=1))
    thread = threading.Thread(target=running.run, kwargs={"sockets": [listener]}, name="page")
    thread.start()
    try:
        addresses = {role: f"http://{host}/?token={quote(token)}" for role, token in TOKENS.items()}
        yield ScriptedPage(addresses[ORDERS], addresses[LOOKS], link, recordings)
    finally:
        server.end()
        running.should_exit = True
        thread.join()
