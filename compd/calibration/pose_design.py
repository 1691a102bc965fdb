"""D-optimal choice of poses by exchange, and indices of how well numbers are observed.

Of all numbers, those of the machine have their tolerance as prior, those of the instrument's registration none. The
criterion is the determinant of the machine's information with the registration taken out,

    D = log det M - log det M_r,  M = S + sum_k A_k^T A_k,

in which A_k are a pose's rows over the noise, S the prior's information, and M_r the part of the registration. It is
the D_s criterion of the machine's numbers (V. V. Fedorov, Theory of Optimal Experiments, 1972), with a prior.

Source of the exchange: T. J. Mitchell, Technometrics 16 (1974) 203 (DETMAX): excursions that add poses and take others
away, longer ones where short ones find nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray

# A combination that moves no row by this share of what the strongest moves is told by none: a motion of the whole base
# with the instrument's frame. Columns are computed to 1e-9.
_UNTOLD = 1e-6
# Information of a number of the registration without a prior, against that of a tolerance, 1.
_NO_PRIOR = 1e-6
# Mitchell's excursions: at most so many poses more, or fewer, than wanted.
_LONGEST_EXCURSION = 4
# Gain of D below which an excursion is rounding.
_LEAST_GAIN = 1e-9


class Information(NamedTuple):
    """Rows of N candidates over the noise.

    machine : (N, m, P) by the machine's numbers, per tolerance.  registration : (N, m, Q) by those of the instrument.
    """

    machine: FloatArray
    registration: FloatArray

    @property
    def rows(self) -> FloatArray:
        """(N, m, P + Q)."""
        return np.concatenate([self.machine, self.registration], axis=2)


def exchange(information: Information, count: int, measured: Information | None = None) -> IntArray:
    """(count,) different candidates with the largest D, beginning with the best one at a time.

    measured : poses that were measured already, with the same numbers of the registration; they stay.
    """
    design = _Design(information, measured)
    for _ in range(min(count, len(information.machine))):
        design.add()
    length, best = 1, design.criterion
    while length <= _LONGEST_EXCURSION:
        before = list(design.chosen)
        for first in (design.add, design.drop):
            for step in [first] * length + [design.drop if first == design.add else design.add] * length:
                step()
            if design.criterion > best + _LEAST_GAIN:
                break
            design.set(before)
        improved = design.criterion > best + _LEAST_GAIN
        best, length = design.criterion, 1 if improved else length + 1
    return np.array(design.chosen, dtype=np.int64)


class _Design:
    """A set of candidates, with the inverse of its information for all candidates' gains at once."""

    def __init__(self, information: Information, measured: Information | None) -> None:
        self._machine = information.machine.shape[2]
        # numbers of the registration in units in which a row moves by about one standard deviation
        size = np.ones(information.rows.shape[2])
        size[self._machine :] = np.sqrt((information.registration**2).mean(axis=(0, 1)))
        self._A = information.rows / np.where(size > 0, size, 1.0)
        numbers = self._A.shape[2]
        prior = np.full(numbers, _NO_PRIOR)
        prior[: self._machine] = 1.0
        self._first = np.diag(prior)
        if measured is not None:
            rows = (measured.rows / np.where(size > 0, size, 1.0)).reshape(-1, numbers)
            self._first = self._first + rows.T @ rows
        self.chosen: list[int] = []
        self.set([])

    def set(self, chosen: list[int]) -> None:
        """Take exactly these candidates."""
        self.chosen = list(chosen)
        rows = self._A[self.chosen].reshape(-1, self._A.shape[2])
        self._M = self._first + rows.T @ rows

    @property
    def criterion(self) -> float:
        """D of the design."""
        own = self._machine
        registration = np.linalg.slogdet(self._M[own:, own:])[1] if own < len(self._M) else 0.0
        return float(np.linalg.slogdet(self._M)[1] - registration)

    def add(self) -> None:
        """The candidate with the largest gain that is not in it."""
        gains = self._gains(1.0)
        gains[self.chosen] = -np.inf
        self.set([*self.chosen, int(np.argmax(gains))])

    def drop(self) -> None:
        """The one of the design that is missed least."""
        losses = self._gains(-1.0)[self.chosen]
        self.set([k for place, k in enumerate(self.chosen) if place != int(np.argmax(losses))])

    def _gains(self, sign: float) -> FloatArray:
        """(N,) change of D by adding (1) or taking away (-1) each candidate: det(1 + A M^-1 A^T) of both parts."""
        whole = self._change(self._A, self._M, sign)
        own = self._machine
        if own == len(self._M):
            return whole
        registration = self._change(self._A[:, :, own:], self._M[own:, own:], sign)
        return np.where(np.isfinite(whole), whole - np.where(np.isfinite(registration), registration, 0.0), -np.inf)

    @staticmethod
    def _change(A: FloatArray, M: FloatArray, sign: float) -> FloatArray:
        inner = A @ np.linalg.inv(M) @ A.transpose(0, 2, 1)
        signs, logs = np.linalg.slogdet(np.eye(A.shape[1]) + sign * inner)
        return np.where(signs > 0, logs, -np.inf)


class Observability(NamedTuple):
    """Indices of n poses from the L singular values s of their rows, over the noise and per tolerance.

    Larger is better. O1 : (s1 s2 ... sL)^(1/L) / sqrt(n), J.-H. Borm, C.-H. Menq, IJRR 10 (1991) 51.
    O2 : smallest over largest, M. R. Driels, U. S. Pathre, J. Robotic Systems 7 (1990) 537.  O3 : smallest, A. Nahvi,
    J. M. Hollerbach, V. Hayward, ICRA (1994) 989.  O4 : smallest squared over largest, A. Nahvi, J. M. Hollerbach,
    ICRA (1996) 1161.  O5 : 1 / (1/s1 + ... + 1/sL), Y. Sun, J. M. Hollerbach, ICRA (2008) 831.
    combinations : L, those that any pose can tell.  told : how many these poses tell; where these are fewer all indices
    are 0.
    """

    O1: float
    O2: float
    O3: float
    O4: float
    O5: float
    combinations: int
    told: int


def observability(J: FloatArray, told: FloatArray, poses: int) -> Observability:
    """The indices. J : (n m, P), the registration projected out.  told : (P, L) orthonormal, what any pose can tell."""
    s = np.linalg.svd(J @ told, compute_uv=False)
    rank = int((s > _UNTOLD * s[0]).sum())
    if rank < told.shape[1]:
        return Observability(0.0, 0.0, 0.0, 0.0, 0.0, told.shape[1], rank)
    return Observability(
        O1=float(np.exp(np.log(s).mean()) / np.sqrt(poses)),
        O2=float(s[-1] / s[0]),
        O3=float(s[-1]),
        O4=float(s[-1] ** 2 / s[0]),
        O5=float(1.0 / (1.0 / s).sum()),
        combinations=told.shape[1],
        told=rank,
    )


def told_directions(J: FloatArray) -> FloatArray:
    """(P, L) combinations of numbers that some row of (n, P) moves, with the registration projected out."""
    _, s, Vt = np.linalg.svd(J, full_matrices=False)
    return np.asarray(Vt[s > _UNTOLD * s[0]].T)
