"""What a simulated instrument has seen: every look, samples at a constant rate, and one point per dwell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from compd.errors import CompdError
from compd.simulation.wires.instrument_sampling import MIN_LOOKS, Looks


def seen(time_s: float, x_mm: float, moving: bool) -> dict[str, Any]:
    return {
        "monotonic_s": 1000.0 + time_s,
        "reference_mm": [x_mm, 2.0, 3.0],
        "link_mm": [0.0, -x_mm, 1.0],
        "moving": moving,
    }


def looks_of(link: int | None = None) -> Looks:
    """Two dwells of four looks at 10 and 20 mm, a move between them, and a dwell that was hardly seen."""
    looks = Looks(link)
    noise = (0.1, -0.1, 0.2, -0.2)
    for k, off in enumerate(noise):
        looks.add(seen(0.1 * k, 10.0 + off, False))
    looks.add(seen(0.45, 15.0, True))
    for k, off in enumerate(noise):
        looks.add(seen(0.5 + 0.1 * k, 20.0 + off, False))
    looks.add(seen(0.9, 25.0, True))
    for _ in range(MIN_LOOKS - 1):
        looks.add(seen(1.0, 30.0, False))
    return looks


def test_a_track_has_every_look_on_a_clock_from_zero() -> None:
    track = looks_of().track()
    assert track.axes == ("x", "y", "z")
    assert track.time_s is not None
    np.testing.assert_allclose(track.time_s[[0, 4, 5]], [0.0, 0.45, 0.5])
    np.testing.assert_allclose(track.values[4], [15.0, 2.0, 3.0])
    assert len(track.values) == len(looks_of()) == 12


def test_one_point_per_dwell_that_was_seen_often_enough() -> None:
    points = looks_of().points()
    assert (points.names, points.time_s) == (["P1", "P2"], None)
    np.testing.assert_allclose(points.values, [[10.0, 2.0, 3.0], [20.0, 2.0, 3.0]])


def test_a_length_along_one_link() -> None:
    points = looks_of(link=2).points()
    assert points.axes == ("length",)
    np.testing.assert_allclose(points.values, [[-10.0], [-20.0]])
    with pytest.raises(CompdError, match="has no such link"):
        Looks(link=4).check_links(3)


def test_samples_at_a_constant_rate_lie_between_the_looks() -> None:
    samples = looks_of().at_rate(20.0)
    assert samples.time_s is not None
    np.testing.assert_allclose(np.diff(samples.time_s), 0.05)
    assert samples.time_s[-1] == pytest.approx(1.0)
    assert samples.values[8, 0] == pytest.approx(9.8 + (15.0 - 9.8) * 2 / 3)  # at 0.4 s, between 0.3 and 0.45 s
    assert samples.rate_hz == pytest.approx(20.0)
