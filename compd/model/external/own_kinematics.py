"""Kinematics of a person's own: a class that gives the pose of a machine that compd does not know.

What it returns is checked here, and whatever it raises becomes an OwnKinematicsError, so that a cycle is refused with
the reason and the loop goes on.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from compd.arrays import FloatArray
from compd.errors import CompdError

# Step of the central differences, mm: their error is a third derivative times its square, some 1e-8 of a derivative on
# a machine of some 100 mm, and rounding adds as little.
_STEP_MM = 0.01
# Numbers of a pose: of the tip alone, and with the rotation vector.
_TIP, _TIP_AND_ROTATION = 3, 6


class OwnKinematicsError(CompdError):
    """A person's own kinematics gives no pose for these scales and settings."""


class Kinematics(ABC):
    """Base class of kinematics of your own, for `machine: external`. It is made without arguments.

    Attributes
    ----------
    settings : tuple of str
        Names of the quantities that `pose` needs, as under ``wiring: quantities:``; none by default.
    gives : tuple of str
        Names of the columns that `columns` returns, such as ``d_arm_x_mm``; none by default.
    """

    settings: ClassVar[tuple[str, ...]] = ()
    gives: ClassVar[tuple[str, ...]] = ()

    @property
    def name(self) -> str:
        """What messages call it: the name of the class."""
        return type(self).__name__

    @abstractmethod
    def pose(self, scale_mm: FloatArray, settings: Mapping[str, float]) -> ArrayLike:
        """Where the tip is.

        Parameters
        ----------
        scale_mm : (n,) array
            The scales since machine zero, with their signs.
        settings : dict
            The quantities named by the attribute `settings`, in their own units.

        Returns
        -------
        (3,) or (6,) array
            The tip in the machine's frame {M}, mm; of six numbers the last three are the rotation vector of what
            carries the tip, rad.
        """

    def derivatives(self, scale_mm: FloatArray, settings: Mapping[str, float]) -> ArrayLike:
        """By how much each number of the pose changes with each scale; by central differences unless overridden.

        Returns
        -------
        (3, n) or (6, n) array
            mm per mm, and rad per mm.
        """
        columns = []
        for step in _STEP_MM * np.eye(len(scale_mm)):
            ahead, behind = (np.asarray(self.pose(scale_mm + sign * step, settings), dtype=float) for sign in (1, -1))
            columns.append((ahead - behind) / (2.0 * _STEP_MM))
        if not columns:
            return np.zeros((_TIP_AND_ROTATION, 0))
        return np.stack(columns, axis=1)

    def columns(self, scale_mm: FloatArray, settings: Mapping[str, float]) -> Mapping[str, float]:
        """What effects read beside gauges, by the names in `gives`: derivatives of the pose by the parameters of the
        kinematics, as columns ``d_<parameter>_x_mm`` of a recording."""
        return {}


class OwnPose(NamedTuple):
    """What own kinematics, or a client, gives of one snapshot.

    tip_M_mm (3,).  rotation_M_rad (3,): rotation vector; nan where only the tip is given.
    by_scale : (6, n), the pose by the scales; nan where that is not known.
    """

    tip_M_mm: FloatArray
    rotation_M_rad: FloatArray
    by_scale: FloatArray


def own_pose(kinematics: Kinematics, scale_mm: FloatArray, settings: Mapping[str, float]) -> OwnPose:
    """The pose with its derivatives. Raises OwnKinematicsError for whatever the class does wrong."""
    numbers = _asked(kinematics, "pose", kinematics.pose, scale_mm, settings)
    if numbers.shape not in {(_TIP,), (_TIP_AND_ROTATION,)} or not np.isfinite(numbers).all():
        raise _wrong(kinematics, "pose", numbers, "3 or 6 finite numbers")
    by_scale = _asked(kinematics, "derivatives", kinematics.derivatives, scale_mm, settings)
    links = len(scale_mm)
    if by_scale.shape not in {(_TIP, links), (_TIP_AND_ROTATION, links)} or not np.isfinite(by_scale).all():
        raise _wrong(kinematics, "derivatives", by_scale, f"finite numbers of shape (3, {links}) or (6, {links})")
    return OwnPose(numbers[:_TIP], _completed(numbers)[_TIP:], _completed(by_scale))


def given_pose(numbers: ArrayLike, rotation_rad: ArrayLike | None, by_scale: ArrayLike | None, links: int) -> OwnPose:
    """The pose that a client gives, of a machine with so many links. Raises OwnKinematicsError for derivatives that are
    missing or have another shape."""
    tip_mm = np.asarray(numbers, dtype=float)
    rotation = np.full(3, np.nan) if rotation_rad is None else np.asarray(rotation_rad, dtype=float)
    if by_scale is None and links:
        raise OwnKinematicsError.of(
            "TARGET",
            "has no derivatives, by which effects of links are carried to the tip",
            next_step=f"send `tip_by_scale`, 3 or 6 rows of {links} numbers",
        )
    rows = np.zeros((_TIP_AND_ROTATION, 0)) if by_scale is None else np.asarray(by_scale, dtype=float)
    if rows.shape not in {(_TIP, links), (_TIP_AND_ROTATION, links)}:
        raise OwnKinematicsError.of(
            "TARGET",
            "`tip_by_scale` has another shape than the machine",
            value=str(rows.shape),
            allowed=f"(3, {links}) or (6, {links})",
        )
    return OwnPose(tip_mm, rotation, _completed(rows))


def own_columns(kinematics: Kinematics, scale_mm: FloatArray, settings: Mapping[str, float]) -> dict[str, FloatArray]:
    """What effects read of it, by name, each (). Raises OwnKinematicsError where one of `gives` is not among them."""
    if not kinematics.gives:
        return {}
    try:
        found = kinematics.columns(scale_mm.copy(), settings)
        columns = {name: np.array(float(found[name])) for name in kinematics.gives}
    except (Exception, SystemExit) as error:
        raise _failed(kinematics, "columns", error) from error
    if not all(map(np.isfinite, columns.values())):
        raise _wrong(kinematics, "columns", np.array(list(columns.values())), "finite numbers")
    return columns


def _asked(
    kinematics: Kinematics, what: str, method: Callable[..., Any], scale_mm: FloatArray, settings: Mapping[str, float]
) -> FloatArray:
    """What a method returns, as an array. A person's own code may raise anything."""
    try:
        return np.array(method(scale_mm.copy(), settings), dtype=np.float64)
    except (Exception, SystemExit) as error:
        raise _failed(kinematics, what, error) from error


def _failed(kinematics: Kinematics, what: str, error: BaseException) -> OwnKinematicsError:
    return OwnKinematicsError.of(
        _name(kinematics, what), f"fails: {type(error).__name__}: {error}", next_step="mend it"
    )


def _wrong(kinematics: Kinematics, what: str, found: FloatArray, allowed: str) -> OwnKinematicsError:
    return OwnKinematicsError.of(
        _name(kinematics, what),
        "gives no such numbers for these scales",
        value=str(found.tolist()) if found.size <= _TIP_AND_ROTATION else f"shape {found.shape}",
        allowed=allowed,
    )


def _name(kinematics: Kinematics, what: str) -> str:
    return f"kinematics {kinematics.name}.{what}"


def _completed(numbers: FloatArray) -> FloatArray:
    """Rows for the rotation, nan where there are only those of the tip."""
    if len(numbers) == _TIP_AND_ROTATION:
        return numbers
    return np.concatenate([numbers, np.full((_TIP, *numbers.shape[1:]), np.nan)])
