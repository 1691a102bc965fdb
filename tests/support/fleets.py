"""Results of fleets for tests: machines with campaigns, without recordings behind them."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

from compd.fleet import RecordingResult
from compd.fleet.recording_result import FleetEstimate

BEGAN = datetime(2026, 1, 5, 8, tzinfo=UTC)


def result(machine: str, campaign: int = 0, estimates: Sequence[FleetEstimate] = (), **changes: Any) -> RecordingResult:
    """A diagnosis that found what it is told, on a recording of a campaign; they are a week apart."""
    attributes = {
        "recording": f"/data/{machine}/{campaign:02d}.csv",
        "machine": machine,
        "kinematics": "tripod_3spr",
        "command": "diagnose",
        "started_at": BEGAN + timedelta(weeks=campaign),
        "rows": 600,
        "rms_before_um": 0.5,
        "rms_after_um": 0.17 if estimates else float("nan"),
        "noise_floor_um": 0.16,
        "verdict": "identified" if estimates else "adequate",
        "summary": "What is missing is known.",
        "estimates": tuple(estimates),
    }
    return RecordingResult(**{**attributes, **changes})


def expansion(value: float, standard_error: float = 0.02, rivals: tuple[str, ...] = ()) -> FleetEstimate:
    """Links that grow by so many ppm/K."""
    return FleetEstimate("link_expansion", "a", value, standard_error, "ppm/K", 0.001, True, rivals)


def machine(name: str, values: Sequence[float], standard_error: float = 0.02, **changes: Any) -> list[RecordingResult]:
    """Campaigns of one machine, on each of which its links grow by the value in ppm/K."""
    return [result(name, k, [expansion(value, standard_error)], **changes) for k, value in enumerate(values)]
