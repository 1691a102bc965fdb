"""Motion that no reading shows yet, of each scale by itself."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from tests.worlds.departure import RESTED, Departure

ACCELERATION = 1000.0
PERIOD_S, DUE_S = 0.005, 0.025


class Machine:
    """Two links that rest until 1 s, and go on by `way` (mm by time since then); scales read when a test says."""

    def __init__(self, rests_s: float = 1.0, acceleration: float = ACCELERATION) -> None:
        self.departure = Departure(np.array([1e-3, 1e-3]), np.full(2, acceleration))
        self.leaves_s = 10.0
        self.rests_from_s = self.leaves_s - rests_s
        self._told_s = self.rests_from_s - 1.0

    def place(self, time_s: float) -> float:
        if time_s < self.rests_from_s:
            return self.rests_from_s - time_s
        return 0.5 * 500.0 * max(time_s - self.leaves_s, 0.0) ** 2

    def speed(self, time_s: float) -> float:
        return -1.0 if time_s < self.rests_from_s else 500.0 * max(time_s - self.leaves_s, 0.0)

    def unseen(self, now_s: float, read_s: Sequence[float]) -> list[bool]:
        """After setpoints until now. read_s : (2,) of the newest readings now."""
        while self._told_s < now_s - PERIOD_S / 2:
            self._at(self._told_s, [self._told_s - 0.002] * 2)
            self._told_s += PERIOD_S
        return self._at(now_s, read_s)

    def _at(self, now_s: float, read_s: Sequence[float]) -> list[bool]:
        moving = now_s < self.rests_from_s or now_s > self.leaves_s
        return self.departure.unseen(
            now_s,
            moving,
            np.full(2, self.place(now_s)),
            np.full(2, self.speed(now_s)),
            np.array(read_s),
            lambda: np.array([self.place(time_s) for time_s in read_s]),
            np.full(2, DUE_S),
        ).tolist()


@pytest.mark.parametrize(
    ("read_s", "unseen"),
    [
        ([9.998, 9.999], [True, True]),
        ([9.998, 10.009], [True, False]),
        ([10.001, 10.009], [True, False]),  # sampled after it has left, and shows nothing yet
        ([9.980, 10.009], [False, False]),  # overdue, while another shows the departure
        ([9.980, 9.999], [True, True]),  # overdue, while another stands
        ([9.980, 9.981], [False, False]),  # nobody answers
    ],
)
def test_a_departure_is_unseen_until_a_scale_shows_it(read_s: list[float], unseen: list[bool]) -> None:
    assert Machine().unseen(10.010, read_s) == unseen


def test_a_departure_after_a_short_rest_is_no_blind_spot() -> None:
    age_s = 0.012
    assert Machine(rests_s=1.2 * RESTED * age_s).unseen(10.010, [10.010 - age_s] * 2) == [True, True]
    assert Machine(rests_s=0.8 * RESTED * age_s).unseen(10.010, [10.010 - age_s] * 2) == [False, False]


def test_a_collision_is_unseen_until_the_next_reading() -> None:
    departure = Departure(np.array([1e-3]), np.array([ACCELERATION]))

    def unseen(now_s: float, speed: float, read_s: float) -> bool:
        place = np.array([min(now_s, 10.0) * 100.0])
        found = departure.unseen(
            now_s, speed > 0, place, np.array([speed]), np.array([read_s]), lambda: place, np.array([DUE_S])
        )
        return bool(found[0])

    assert not unseen(9.995, 100.0, 9.990)
    assert not unseen(10.000, 100.0, 9.990)
    assert unseen(10.005, 0.0, 9.990)
    assert not unseen(10.010, 0.0, 10.006)
    assert not unseen(10.020, 0.0, 9.990)


def test_drives_change_their_speed_as_they_state() -> None:
    slow, fast = Machine(acceleration=600.0), Machine(acceleration=math.inf)
    for machine in (slow, fast):
        assert machine.unseen(10.050, [10.045] * 2) == [False, False]
