"""What a machine's small disturbances, too small to be named, do to fitted numbers: a part of their standard errors."""

from __future__ import annotations

import numpy as np

from compd.workbench.contest import Contest, Members
from compd.workbench.table import FloatArray

# Always there, in standard deviations of the noise, rms per coordinate: two of a fifth of the floor.
DISTURBANCE = 0.2
DISTURBANCES = 2


def disturbance_covariance(contest: Contest, members: Members) -> list[FloatArray]:
    """(P, P) for each member: by how much its numbers move when two other effects of the library act a little.

    Every other effect is as likely, and every of its columns in equal parts; a number's error by the noise alone
    would be too small where an unnamed disturbance looks like the effect. (GUM, 4.3: an error of which only the
    size is known is an uncertainty all the same.)
    """
    if not members:
        return []
    columns = np.concatenate([contest.evidence.always.values, *(contest.values[k] for k in members)], axis=2)
    A = columns.reshape(-1, columns.shape[2])
    index = contest.index(members)
    normal = A.T @ A + np.diag(contest.sums.ridge[index])
    size = np.sqrt(np.diag(normal))
    inverse = np.linalg.pinv(normal / np.outer(size, size), rcond=1e-10, hermitian=True) / np.outer(size, size)
    total = np.zeros((len(index), len(index)))
    taken = {contest.name(k) for k in members}
    others = {name: entry.members[0] for name, entry in contest.best_variant.items() if name not in taken}
    effects = [k for k in others.values() if not contest.candidates[k].described]
    for k in effects:
        u = contest.values[k].reshape(len(A), -1)
        u = u / np.maximum(np.sqrt(np.mean(u**2, axis=0)), 1e-12)
        moved = inverse @ (A.T @ u)
        total += moved @ moved.T * (DISTURBANCE**2 * DISTURBANCES / u.shape[1] / len(effects))
    found, begin = [], contest.evidence.always.values.shape[2]
    for k in members:
        end = begin + contest.values[k].shape[2]
        found.append(total[begin:end, begin:end])
        begin = end
    return found
