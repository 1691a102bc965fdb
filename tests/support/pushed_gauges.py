"""What the tests of lines that speak by themselves share: the line's thread with its gauges, and their readings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from compd.gauge import Gauge
from compd.live.acquisition import Acquisition, ReadingTrust
from compd.live.system import THIS_COMPUTER, System
from compd.plugins import GAUGES, load
from tests.support.patience import PATIENCE_S
from tests.support.wire_rig import SETTINGS, WatchedLatest

# A value does not grow old on its way, however busy the computer is: a test puts the clock forward where it is to.
STALE_AFTER_S = PATIENCE_S


def gauge(driver: str, **options: Any) -> Gauge[Any]:
    kind = load(GAUGES, driver, driver)
    return kind(kind.Options.model_validate({"driver": driver, "line": "l", **options}))  # type: ignore[no-any-return]


@contextmanager
def acquiring(
    line: Mapping[str, Any],
    gauges: Mapping[str, Gauge[Any]],
    trust: Mapping[str, ReadingTrust] | None = None,
    stale_after_s: float = STALE_AFTER_S,
    clock: System | None = None,
) -> Iterator[tuple[Acquisition, WatchedLatest]]:
    """The line `l` with its thread, and its gauges' readings. clock : None for the real one."""
    channels: Sequence[str] = [f"{name}.{channel.name}" for name, each in gauges.items() for channel in each.channels]
    latest = WatchedLatest(channels)
    settings = SETTINGS.validate_python({"timeout_s": PATIENCE_S, "back_off_s": [0.05, 0.2], **line})
    lines = {"l": (settings, list(gauges.items()))}
    stale = dict.fromkeys(gauges, stale_after_s)
    acquisition = Acquisition(lines, stale, latest, clock or THIS_COMPUTER, trust=trust or {})
    acquisition.start()
    try:
        yield acquisition, latest
    finally:
        assert acquisition.stop(PATIENCE_S)
