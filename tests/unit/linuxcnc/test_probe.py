"""The simulated touch probe: it trips where the calibrated face truly is, whatever the controller believes."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import controller
from artefact import CORNERS_mm

PERIOD_S = 0.001
# The link looks so often, at a sample that is so old when the pins change.
LOOK_EVERY, OLD = 50, 20
FEED_MM_PER_S = 10 / 60
PROBE_HAL = Path(controller.__file__).with_name("probe.hal")


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The component's module, with a `hal` that it does not use here."""
    monkeypatch.setitem(sys.modules, "hal", ModuleType("hal"))
    return importlib.import_module("machine_link")


class ProbeHal:
    """What probe.hal computes in each servo period."""

    def __init__(self, hysteresis_mm: float) -> None:
        self.pins: dict[str, Any] = {"aimed": False, "distance": 0.0, "normal-x": 0.0, "normal-y": 0.0, "normal-z": 0.0}
        self._hysteresis_mm = hysteresis_mm
        self._contact = False

    def trips(self, believed_mm: np.ndarray) -> bool:
        inside_mm = self.pins["distance"] - sum(
            self.pins[f"normal-{axis}"] * place for axis, place in zip("xyz", believed_mm, strict=True)
        )
        if abs(inside_mm) > self._hysteresis_mm / 2:
            self._contact = inside_mm > 0
        return self._contact and bool(self.pins["aimed"])


def touch(link: Any, axis: int, error_mm: np.ndarray) -> float:
    """Approach a face of the first corner slowly; where the tip truly is along the axis when the probe trips."""
    corner_mm = np.array(CORNERS_mm[0])
    hal = ProbeHal(link.HYSTERESIS_MM)
    probe = link.Probe(hal.pins, [list(corner) for corner in CORNERS_mm])
    start_mm = corner_mm - 3.0
    start_mm[axis] = corner_mm[axis] + 0.1
    step_mm = np.zeros(3)
    step_mm[axis] = -FEED_MM_PER_S * PERIOD_S
    for number in range(2000):
        believed_mm = start_mm + number * step_mm
        if number % LOOK_EVERY == 0:
            sample_mm = start_mm + max(0, number - OLD) * step_mm
            probe.aim(sample_mm.tolist(), (sample_mm + error_mm).tolist())
        if hal.trips(believed_mm):
            return float((believed_mm + error_mm)[axis])
    raise AssertionError("it never trips")


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("error_um", [(0.0, 0.0, 0.0), (15.0, -8.0, 11.0), (-20.0, 20.0, -20.0)])
def test_it_trips_at_the_true_face_within_the_way_of_two_periods(
    link: Any, axis: int, error_um: tuple[float, float, float]
) -> None:
    true_mm = touch(link, axis, np.array(error_um) * 1e-3)
    assert 0.0 <= CORNERS_mm[0][axis] - true_mm <= 2 * FEED_MM_PER_S * PERIOD_S


def test_on_another_face_it_is_not_aimed_at_once(link: Any) -> None:
    """The pins change one after the other; nothing may trip in between."""
    hal = ProbeHal(link.HYSTERESIS_MM)
    probe = link.Probe(hal.pins, [list(corner) for corner in CORNERS_mm])
    x, y, z = CORNERS_mm[0]
    above_mm, beside_mm = [x - 3, y - 3, z + 1], [x + 1, y - 3, z - 3]
    aimed = []
    for place_mm in (above_mm, above_mm, beside_mm, beside_mm):
        probe.aim(place_mm, place_mm)
        aimed.append(hal.pins["aimed"])
        assert not hal.trips(np.array(place_mm))
    assert aimed == [False, True, False, True]


def test_the_hysteresis_of_the_hal_file_is_the_one_that_the_link_counts_with(link: Any) -> None:
    written = re.search(r"^setp probe-contact\.hyst (\S+)$", PROBE_HAL.read_text(), re.MULTILINE)
    assert written is not None
    assert float(written[1]) == link.HYSTERESIS_MM


def test_a_sample_of_the_sampler_is_read_in_the_order_of_the_hal_file(link: Any) -> None:
    line = b" ".join([b"1234", *(f"{value:.6f}".encode() for value in range(15)), b"1", b"0", b"1"])
    sample = link.read_sample(line)
    assert sample.number == 1234
    assert sample.nominal_mm == [0, 1, 2, 3, 4, 5]
    assert sample.drive_mm == [6, 7, 8, 9, 10, 11]
    assert sample.believed_mm == [12, 13, 14]
    assert sample.bits == [True, False, True]
    text = PROBE_HAL.with_name("machine.hal").read_text()
    order = dict(re.findall(r"^net (\S+) .*=> sampler\.0\.pin\.(\d+)$", text, re.MULTILINE))
    assert [order[name] for name in ("believed-x", "compd-inhibit", "read-gauges")] == ["12", "16", "17"]
    wired = [re.search(rf"^net (\S+) => sampler\.0\.pin\.{pin}$", text, re.MULTILINE) for pin in range(12)]
    names = [f"{kind}-{link}" for kind in ("command", "drive") for link in range(6)]
    assert [match and match[1] for match in wired] == names
