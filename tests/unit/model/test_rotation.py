"""Rotations and the small linear algebra, against SciPy and NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from scipy.spatial.transform import Rotation

from compd import linear, rotation
from compd.rotation import compose, rotation_matrix, rotation_vector, to_inner, to_outer


def _from_python(helper: Any) -> Any:
    """A helper compiled once more, so that Python can call it."""
    return njit(error_model="numpy")(helper.py_func)


inverse_norm, is_finite, max_abs = map(_from_python, (linear.inverse_norm, linear.is_finite, linear.max_abs))
lu_factor, lu_solve = map(_from_python, (linear.lu_factor, linear.lu_solve))
orthonormalise, rotate_in_place = map(_from_python, (rotation.orthonormalise, rotation.rotate_in_place))

ANGLES = st.tuples(*[st.floats(-6.0, 6.0)] * 3)


@given(ANGLES)
def test_rotations_are_scipys(vector: tuple[float, float, float]) -> None:
    R = rotation_matrix(np.array(vector))
    np.testing.assert_allclose(R, Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(rotation_matrix(rotation_vector(R)), R, atol=1e-14)
    assert np.linalg.norm(rotation_vector(R)) <= np.pi + 1e-12


@pytest.mark.parametrize("size", [0.0, 1e-100, 1e-12, 1e-6, 1e-3, 3.0])
def test_small_rotation_vectors_come_back_to_the_last_bits(size: float) -> None:
    vector = size * np.array([0.6, -0.48, 0.64])
    np.testing.assert_allclose(rotation_vector(rotation_matrix(vector)), vector, rtol=1e-12, atol=1e-300)


@pytest.mark.parametrize("axis", np.eye(3))
def test_half_turns(axis: np.ndarray) -> None:
    found = rotation_vector(rotation_matrix(np.pi * axis))
    np.testing.assert_allclose(np.abs(found), np.pi * axis, atol=1e-12)


def test_a_turn_is_a_rotation_and_right_to_second_order() -> None:
    for angle in (1e-3, 2e-3):
        R = rotation_matrix(np.array([0.3, -0.8, 0.5]))
        wanted = rotation_matrix(angle * np.array([0.6, -0.48, 0.64])) @ R
        rotate_in_place(R, *(angle * np.array([0.6, -0.48, 0.64])))
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-15)
        assert np.abs(R - wanted).max() < 0.1 * angle**3


def test_orthonormalising_squares_the_error() -> None:
    R = rotation_matrix(np.array([0.3, -0.8, 0.5])) + 1e-6 * np.random.default_rng(1).normal(size=(3, 3))
    orthonormalise(R)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-10)


def test_points_go_over_and_back() -> None:
    rng = np.random.default_rng(2)
    R, origin, point = rotation_matrix(rng.normal(size=(20, 3))), rng.normal(size=(20, 3)), rng.normal(size=3)
    outer = to_outer(R, origin, point)
    np.testing.assert_allclose(outer, origin + R @ point, atol=1e-14)
    np.testing.assert_allclose(to_inner(R, origin, outer), np.tile(point, (20, 1)), atol=1e-14)
    np.testing.assert_allclose(compose(R, R[0]), R @ R[0], atol=1e-15)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_not_finite_is_nan_without_a_warning(bad: float) -> None:
    vector = np.array([0.0, bad, 1.0])
    assert np.isnan(rotation_matrix(vector)).all()
    assert np.isnan(to_outer(np.eye(3), np.zeros(3), vector)).all()
    assert np.isnan(to_inner(np.eye(3), np.zeros(3), vector)).all()
    assert not is_finite(bad)


@pytest.mark.parametrize("n", [3, 6, 9])
def test_linear_algebra_is_numpys(n: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(20):
        A, b = rng.normal(size=(n, n)), rng.normal(size=n)
        LU, pivot, x = A.copy(), np.empty(n, np.int64), b.copy()
        assert lu_factor(LU, pivot) == np.sign(np.linalg.det(A))
        lu_solve(LU, pivot, x)
        np.testing.assert_allclose(A @ x, b, atol=1e-10)
        assert inverse_norm(LU, np.empty((n, n))) == pytest.approx(np.linalg.norm(np.linalg.inv(A)), rel=1e-9)
        assert max_abs(b) == np.abs(b).max()


def test_a_singular_matrix_has_no_sign() -> None:
    A = np.outer([1.0, 2.0, 3.0], [4.0, 5.0, 6.0])
    assert lu_factor(A, np.empty(3, np.int64)) == 0.0
