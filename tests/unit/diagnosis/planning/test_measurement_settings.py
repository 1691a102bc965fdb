"""What a person can set on a machine of an external model."""

from __future__ import annotations

import numpy as np
import pytest

from compd.errors import CompdError
from compd.planning.measurement_settings import MAX_LEVELS, settings_of

ROWS = 60
RNG = np.random.default_rng(1)
ELEVATION = RNG.uniform(20.37, 84.9991, ROWS)
MOVED = np.where(np.arange(ROWS) % 2 == 0, 1.0, -1.0)
STOPS = np.repeat([15.0, 20.0, 25.0, 60.0], ROWS // 4)


def test_a_column_of_many_values_is_set_within_its_range_and_rounded_inwards() -> None:
    (setting,) = settings_of({"elevation_deg": ELEVATION}, {})
    assert len(setting.values) == MAX_LEVELS
    assert ELEVATION.min() <= setting.values[0] < ELEVATION.min() + 0.02
    assert ELEVATION.max() - 0.02 < setting.values[-1] <= ELEVATION.max()
    np.testing.assert_array_equal(setting.values, np.round(setting.values, 2))


def test_directions_and_stops_keep_their_values() -> None:
    moved, stops = settings_of({"moved_1": MOVED, "position_mm": STOPS}, {})
    assert moved.values.tolist() == [-1.0, 1.0]
    assert moved.is_direction
    assert stops.values.tolist() == [15.0, 20.0, 25.0, 60.0]
    assert not stops.is_direction


def test_limits_add_their_ends_to_stops_but_not_to_directions() -> None:
    limits = {"position_mm": (18.0, 70.0), "moved_1": (-1.0, 1.0)}
    moved, stops = settings_of({"moved_1": MOVED, "position_mm": STOPS}, limits)
    assert stops.values.tolist() == [18.0, 20.0, 25.0, 60.0, 70.0]
    assert moved.values.tolist() == [-1.0, 1.0]


def test_limits_let_a_constant_column_vary_and_hold_a_varied_one() -> None:
    recorded = {"temperature_bed_degC": np.full(ROWS, 20.0), "elevation_deg": ELEVATION}
    (elevation,) = settings_of(recorded, {})
    assert elevation.name == "elevation_deg"
    bed, held = settings_of(recorded, {"temperature_bed_degC": (18.0, 60.0), "elevation_deg": (45.0, 45.0)})
    assert (bed.values[0], bed.values[-1]) == (18.0, 60.0)
    assert held.values.tolist() == [45.0]


def test_a_column_that_always_followed_another_goes_on_following() -> None:
    recorded = {"position_mm": ELEVATION, "tip_x_mm": 3.0 - 2.0 * ELEVATION, "humidity_pct": RNG.uniform(30, 60, ROWS)}
    position, humidity = settings_of(recorded, {})
    assert [follower.name for follower in position.followers] == ["tip_x_mm"]
    columns = position.columns(position.values)
    np.testing.assert_allclose(columns["tip_x_mm"], 3.0 - 2.0 * position.values, atol=1e-9)
    assert humidity.name == "humidity_pct"
    # a person who gives limits for both can set both
    assert len(settings_of(recorded, {"position_mm": (20.0, 80.0), "tip_x_mm": (0.0, 9.0)})) == 3


def test_empty_cells_do_not_matter() -> None:
    elevation = ELEVATION.copy()
    elevation[3] = np.nan
    (setting,) = settings_of({"elevation_deg": elevation}, {})
    assert np.isfinite(setting.values).all()


def test_a_limit_that_leaves_a_direction_no_value_is_refused() -> None:
    with pytest.raises(CompdError, match="limit of moved_1: leaves no value"):
        settings_of({"moved_1": MOVED}, {"moved_1": (0.2, 0.8)})
