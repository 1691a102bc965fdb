"""The last hour, as numbers."""

from __future__ import annotations

import numpy as np

from compd.page.history import History, Traces

BUDGET = {"tip_um": {"joints": [1.0, 2.0, 3.0], "frame": [0.5, 0.5, 0.5]}}


def setpoint(k, valid=True):
    if not valid:
        return {"state": "stop", "valid": False}
    return {"state": "ok", "valid": True, "correction_mm": [1e-3 * k, 0.0, -1e-3 * k], "tip_M_mm": [1.0, 2.0, 3.0]}


def test_a_row_a_second_is_kept_for_an_hour_and_ten_for_a_minute():
    history = History(3)
    for k in range(4000 * 20):
        history.note(k / 20, setpoint(k), BUDGET)
    (coarse_s, coarse), (fine_s, fine) = history.tables().values()
    assert len(coarse_s) == len(coarse) == 3600
    assert np.allclose(np.diff(coarse_s), 1.0)
    assert len(fine_s) == 600
    assert np.allclose(np.diff(fine_s), 0.1)
    assert coarse_s[-1] > 3998.9
    assert dict(zip(history.columns, fine[-1], strict=True))["moved_z_um"] == 3.5


def test_times_that_jitter_leave_no_row_out():
    history = History(3)
    random = np.random.default_rng(1)
    for k in range(20 * 60):
        history.note(k / 20 + random.uniform(-0.02, 0.02), setpoint(k), BUDGET)
    (coarse_s, _), (fine_s, _) = history.tables().values()
    assert abs(len(coarse_s) - 60) <= 1
    assert abs(len(fine_s) - 600) <= 6


def test_a_clock_that_is_set_back_does_not_stop_it():
    history = History(3)
    for k in range(20 * 10):
        history.note(1000.0 + k / 20, setpoint(k), BUDGET)
    for k in range(20 * 10):
        history.note(400.0 + k / 20, setpoint(k), BUDGET)
    (coarse_s, _), (fine_s, _) = history.tables().values()
    assert (coarse_s < 500.0).sum() == 10
    assert (fine_s < 500.0).sum() == 100


def test_what_is_not_known_is_nan_and_never_the_value_before():
    history = History(3)
    history.note(0.0, setpoint(1), BUDGET)
    history.note(1.0, setpoint(1, valid=False), BUDGET)
    history.note(2.0, None, None)
    history.note(3.0, setpoint(1) | {"state": "of another release", "valid": False}, None)
    _, rows = history.tables()["coarse"]
    assert rows[0, 0] == 2.0
    assert rows[1, 0] == 7.0
    assert np.isnan(rows[1, 1:]).all()
    assert np.isnan(rows[2]).all()
    assert rows[3, 0] == -1.0


def test_the_minute_of_a_gauge_before_a_moment():
    traces = Traces(2)
    for k in range(20 * 100):
        traces.note(k / 20, [{"value": 400.0 + 1e-7 * (k // 20)}, {"fault": "timeout"}])
    traces.note(100.0, [])
    answer = traces.minute(80.0)
    assert len(answer["times_s"]) == 60
    assert answer["times_s"][-1] == 80.0
    assert answer["values"][0][-1] == 400.000008, "to a tenth of a nanometre"
    assert answer["values"][1] == [None] * 60
    assert traces.minute(1e6)["times_s"] == []
