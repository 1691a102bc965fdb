"""The shipped machines' geometry and wiring, and variants of them, for tests of the simulated machine."""

from __future__ import annotations

import json
import socket
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from compd.configuration import Geometry
from compd.documents import read_document
from compd.operation_settings import Wiring
from tests.support.paths import CONFIG

TRIPOD = CONFIG / "tripod-cmm.yaml"
HEXAPOD = CONFIG / "hexapod.yaml"


# A bound of the tip's error, um, that readings as old as a pause of the computer do not reach.
PATIENT_TIP_ERROR_UM = 100_000
# How old readings may be before a person is asked, and how wrong the tip by their age before a setpoint is refused.
_PATIENT = {
    "stale_after_s: 0.5": "stale_after_s: 3.0",
    "tip_error_um: 3000": f"tip_error_um: {PATIENT_TIP_ERROR_UM}",
}

_read = cache(read_document)


def made_patient(text: str) -> str:
    """A shipped configuration for a computer that other tests keep from its work for longer than it allows."""
    for shipped, patient in _PATIENT.items():
        assert text.count(shipped) == 1
        text = text.replace(shipped, patient)
    return text


def section(path: Path, name: str) -> Any:
    """A copy of its own, which a test may change: a file of 300 lines takes 40 ms to read."""
    return deepcopy(_read(path).data[name])


def tripod(turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Geometry:
    """The shipped tripod, the whole of it turned about the origin of {M}."""
    data = section(TRIPOD, "geometry")
    turn = Rotation.from_rotvec(turn_rad)
    base, tool = data["base"], data["tool"]
    base["origin_B0_in_M_mm"] = turn.apply(base["origin_B0_in_M_mm"]).tolist()
    base["rotation_B0_in_M_rad"] = turn.as_rotvec().tolist()
    data["plate_points_M_mm"] = turn.apply(data["plate_points_M_mm"]).tolist()
    tool["zero_tip_M_mm"] = turn.apply(tool["zero_tip_M_mm"]).tolist()
    return Geometry.model_validate(data)


def tripod_with_tool_on_plate() -> Geometry:
    """Figure 15: the work hangs from the tripod, the tool stands on the plate where the tip was at zero."""
    data = section(TRIPOD, "geometry")
    zero_tip_P = np.array(data["tool"]["at_P_mm"]).tolist()
    data["tool"] = {"on": "plate", "at_M_mm": data["tool"]["zero_tip_M_mm"], "zero_tip_P_mm": zero_tip_P}
    return Geometry.model_validate(data)


def hexapod() -> Geometry:
    return Geometry.model_validate(section(HEXAPOD, "geometry"))


def wiring(path: Path = TRIPOD) -> Wiring:
    return Wiring.model_validate(section(path, "wiring"))


@contextmanager
def run_directory() -> Iterator[Path]:
    """A short path: a Unix socket's may have 100 characters."""
    with tempfile.TemporaryDirectory(prefix="compd-") as directory:
        yield Path(directory)


def ask(connection: socket.socket, message: str | Mapping[str, Any]) -> dict[str, Any]:
    """One request on a control socket, one answer."""
    line = message if isinstance(message, str) else json.dumps(message)
    connection.sendall(line.encode() + b"\n")
    answer = b""
    while not answer.endswith(b"\n"):
        piece = connection.recv(4096)
        assert piece, "the connection was closed"
        answer += piece
    return dict(json.loads(answer))
