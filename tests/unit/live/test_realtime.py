"""What the loop asks of the system."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import pytest

from compd.live.processes.loop_process import wake_latency_us
from compd.live.system.realtime import limit_wake_latency
from compd.operation_settings import LoopSettings

LOOP = {"stale_after_s": 0.5, "on_stale": "hold", "hold_s": 1}


def files_open(path: Path) -> list[int]:
    """Descriptors of this process that are open on `path`."""
    links = {int(link.name): str(link.readlink()) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()}
    return [number for number, target in links.items() if target == str(path)]


def test_the_limit_of_wake_latency_is_held_by_a_file_that_stays_open(tmp_path: Path) -> None:
    device = tmp_path / "cpu_dma_latency"
    device.touch()
    permission = limit_wake_latency(7, device)
    assert permission.granted
    assert "7 us" in permission.detail
    assert struct.unpack("=i", device.read_bytes()) == (7,)
    (number,) = files_open(device)
    os.close(number)


def test_a_refused_limit_says_what_it_needs(tmp_path: Path) -> None:
    permission = limit_wake_latency(0, tmp_path / "absent")
    assert not permission.granted
    assert "compd.rules" in permission.detail


@pytest.mark.parametrize(
    ("rate_hz", "given_us", "limit_us"), [(200, None, None), (499, None, None), (500, None, 0), (1000, 50, 50)]
)
def test_processors_stay_awake_for_a_fast_loop_alone(
    rate_hz: float, given_us: int | None, limit_us: int | None
) -> None:
    assert wake_latency_us(LoopSettings(rate_hz=rate_hz, wake_latency_us=given_us, **LOOP)) == limit_us
