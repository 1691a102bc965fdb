"""Cells of a quantity that are no measurement: named with their rows, taken as empty or asked about."""

from __future__ import annotations

import numpy as np
import pytest

from compd.data_fault import DataFault
from compd.recording.quantity_faults import hanging_reference, quantity_faults, without_wild

N = 120
ROW = np.arange(N) + 2
WARMING = np.round(20.0 + 6.0 * (1 - np.exp(-np.arange(N) / 40.0)) + np.random.default_rng(1).normal(0, 0.01, N), 3)


def faults_of(values: np.ndarray, name: str = "temperature_ram_degC") -> list[DataFault]:
    return quantity_faults({name: values}, ROW[: len(values)])


@pytest.mark.parametrize("value", [85.0, -127.0, 0.0, 999.0, 6553.5, 31.7])
@pytest.mark.parametrize("rows", [[50], [50, 51], [0], [N - 1]])
def test_a_wild_value_of_something_slow_counts_as_an_empty_cell(value: float, rows: list[int]) -> None:
    values = WARMING.copy()
    values[rows] = value
    (fault,) = faults_of(values)
    assert fault.rows == tuple(row + 2 for row in rows)
    assert f"temperature_ram_degC is {value:.10g}, where all others are" in fault.text
    cells = without_wild("temperature_ram_degC", values, ROW, [fault])
    assert np.flatnonzero(np.isnan(cells)).tolist() == rows
    np.testing.assert_array_equal(without_wild("temperature_room_degC", values, ROW, [fault]), values)


def test_a_jump_within_the_range_of_the_others_is_wild_too() -> None:
    values = WARMING.copy()
    values[100] = 20.1
    (fault,) = faults_of(values)
    assert fault.rows == (102,)


def test_a_number_that_stands_for_no_reading_may_stand_in_many_rows() -> None:
    values = WARMING.copy()
    values[30:50] = -999.0
    values[80:90] = 85.0
    (fault,) = faults_of(values)
    assert fault.rows == (*range(32, 52), *range(82, 92))
    assert fault.consequence == "cells empty"


@pytest.mark.parametrize("other", [9999.0, 32767.0, 1e30])
def test_of_any_other_quantity_what_devices_write_for_no_reading_counts_as_empty(other: float) -> None:
    force = np.random.default_rng(2).normal(10.0, 2.0, N)
    force[40] = other
    (fault,) = faults_of(force, "force_z_N")
    assert (fault.rows, fault.consequence) == ((42,), "cells empty")


def test_an_angle_far_from_all_others_counts_as_empty() -> None:
    angle = np.random.default_rng(2).uniform(-80.0, 80.0, N)
    angle[40] = 3600.0
    (fault,) = faults_of(angle, "j2_deg")
    assert (fault.rows, fault.consequence) == ((42,), "cells empty")


def test_a_load_in_one_row_is_asked_about_and_used() -> None:
    force = np.random.default_rng(2).normal(0.0, 0.1, N)
    force[40] = 53.71
    (fault,) = faults_of(force, "force_z_N")
    assert (fault.rows, fault.consequence) == ((42,), "used")
    assert "look" in fault.text


@pytest.mark.parametrize(
    "values",
    [
        WARMING,
        np.where(np.arange(N) < 60, 20.0, 60.0),  # a setting
        np.where(np.arange(N) % 20 < 4, 40.0, 20.0) + np.round(np.random.default_rng(3).normal(0, 0.02, N), 2),
        np.round(20.0 + 5 * np.sin(np.arange(N) / 6.0), 1),
        np.concatenate([np.linspace(20, 70, 40), np.full(60, 70.0), np.linspace(70, 40, 20)]),  # held, then off
        np.full(N, 20.0),
    ],
    ids=["warming", "set twice", "pulses", "coarse digits", "held", "constant"],
)
def test_what_machines_do_is_no_fault(values: np.ndarray) -> None:
    assert faults_of(values) == []


def test_a_thermometer_that_hangs_is_asked_about() -> None:
    values = WARMING.copy()
    values[20:70] = values[20]
    (fault,) = faults_of(values)
    assert fault.rows == tuple(range(22, 72))
    assert (fault.consequence, "does the gauge hang?" in fault.text) == ("used", True)


def test_a_reference_that_hangs_while_the_machine_stands_is_asked_about() -> None:
    height = np.round(np.linspace(0.0, 0.09, N) + np.random.default_rng(5).normal(0.0, 1e-3, N), 4)
    assert hanging_reference({"reference_z_mm": height}, ROW, []) == []
    height[30:70] = height[30]
    (fault,) = hanging_reference({"reference_z_mm": height}, ROW, [])
    assert fault.rows == tuple(range(32, 72))
    assert "does the instrument hang?" in fault.text
    assert hanging_reference({"reference_z_mm": height}, ROW, [fault]) == []
