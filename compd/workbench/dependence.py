"""What a residual depends on: every covariate at every port in every form, judged on rows that were left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compd.model.effect import Effect
from compd.workbench.candidates import UM_PER_MM, Candidate
from compd.workbench.descriptions import Description, descriptions, finer
from compd.workbench.evidence import Block, Evidence, sums
from compd.workbench.observed import Observed
from compd.workbench.recording import BoolArray
from compd.workbench.significance import Projection, chances
from compd.workbench.table import FloatArray

# Places between neighbours of a grid that are tried for a step or a period.
FINER = 9
# A direction with a smaller share of what a description explains is left out of the proposal.
LEAST_SHARE = 0.03
# Descriptions that are judged on left-out rows, of those that explain most where they were fitted.
PROMISING = 60
# So many are computed at once: a balance of memory and overhead.
TOGETHER = 64
# A chance above this is no finding.
SIGNIFICANT = 0.05


@dataclass(frozen=True, eq=False)
class Searched:
    """A description at one value of its shape constant: values (R, m, P) whitened, on the rows of the evidence."""

    description: Description
    effect: Effect
    constant: float | None
    values: FloatArray

    @property
    def block(self) -> Block:
        """Of its numbers nothing is known."""
        return Block(self.values, np.full(self.values.shape[2], np.inf))

    def candidate(self, columns_um: FloatArray) -> Candidate:
        """As a competitor of the library's effects."""
        name = f"{self.description.covariate} {self.description.form}"
        shape = {self.description.constant: self.constant} if self.constant is not None else {}
        limits = np.tile([-np.inf, np.inf], (columns_um.shape[2], 1))
        return Candidate(name, self.effect, shape, columns_um, limits, len(shape))


@dataclass(frozen=True)
class Dependence:
    """One thing that the residual follows.

    explained_fraction : of what is above the noise, on rows that were left out.
    formula_effects : ready to paste; the first is the largest.  gain_um : by how much the rms falls there.
    """

    covariate: str
    form: str
    port: str
    p_adjusted: float
    explained_fraction: float
    heldout_rms_um: float
    formula_effects: tuple[dict[str, Any], ...]
    numbers: tuple[dict[str, float], ...]

    def as_json(self) -> dict[str, Any]:
        """The keys of the verdict's `depends_on`."""
        return {
            "covariate": self.covariate, "form": self.form, "port": self.port, "p_adjusted": self.p_adjusted,
            "explained_fraction": self.explained_fraction, "heldout_rms_um": self.heldout_rms_um,
            "formula_effect": self.formula_effects[0], "formula_effects": list(self.formula_effects),
            "fitted": list(self.numbers), "note": "a description, not a cause",
        }  # fmt: skip


class Whitener:
    """Columns of a description in standard deviations of the noise, on the rows that count."""

    def __init__(self, seen: Observed, rows: BoolArray, sigma_um: FloatArray) -> None:
        self.seen, self._rows, self._sigma_um = seen, rows, sigma_um

    def columns_um(self, description: Description, effect: Effect, constant: float | None) -> FloatArray:
        """(N, m, P): all numbers of the first axis, then of the next."""
        shape = {} if constant is None else {description.constant: constant}
        if description.axes == ("",):
            return self.seen.columns(effect, shape) * UM_PER_MM
        factors, _ = effect.basis(self.seen.rows, shape, None)
        factors = factors[:, "xyz".index(description.axes[0])] * UM_PER_MM
        along = self._along(description)
        return np.asarray((along[:, :, :, None] * factors[:, None, None, :]).reshape(*along.shape[:2], -1))

    def _along(self, description: Description) -> FloatArray:
        """(N, m, axes) what is measured of a displacement along each axis at the port."""
        axes = ["xyz".index(axis) for axis in description.axes]
        if description.port == "reference":
            return np.broadcast_to(
                np.eye(3)[list(self.seen.axes)][:, axes], (len(self.seen.rows), len(self.seen.axes), len(axes))
            )
        return self.seen.sensitivity(["tool"])["tool"].tip[:, list(self.seen.axes)][:, :, axes]

    def __call__(self, columns_um: FloatArray) -> FloatArray:
        """(R, m, P)."""
        return np.asarray(columns_um[self._rows] / self._sigma_um[:, None])


class Everything:
    """Every description on a recording, at every value of its shape constant, as one table of columns."""

    def __init__(self, whiten: Whitener) -> None:
        self._whiten = whiten
        by_size: dict[int, list[Searched]] = {}
        for description in descriptions(whiten.seen):
            effect = description.effect()
            for constant in description.grid or (None,):
                values = whiten(whiten.columns_um(description, effect, constant))
                if np.isfinite(values).all() and values.any():
                    by_size.setdefault(values.shape[2], []).append(Searched(description, effect, constant, values))
        self._by_size = by_size

    def best(self, y: FloatArray, basis: FloatArray) -> list[Searched]:
        """Each description at its best constant beside `basis` (R, m, Q), the PROMISING ones that explain most of y.

        Steps and periods are then looked for more finely.
        """
        beside = Projection(basis)
        left = beside(y)
        best: dict[Description, tuple[float, Searched]] = {}
        for members in self._by_size.values():
            for one, explained in zip(members, _explained(members, left, beside).tolist(), strict=True):
                if one.description not in best or explained > best[one.description][0]:
                    best[one.description] = explained, one
        order = sorted(best.values(), key=lambda pair: -pair[0])[:PROMISING]
        return [self._finer(one, left, beside) for _, one in order]

    def _finer(self, one: Searched, left: FloatArray, beside: Projection) -> Searched:
        if one.constant is None or one.description.form not in ("step", "periodic"):
            return one
        around = [one]
        for value in finer(one.description, one.constant, FINER):
            values = self._whiten(self._whiten.columns_um(one.description, one.effect, value))
            around.append(replace(one, constant=value, values=values))
        return around[int(np.argmax(_explained(around, left, beside)))]


def _explained(members: Sequence[Searched], left: FloatArray, beside: Projection) -> FloatArray:
    """(K,) squares that each explains; all have equally many columns."""
    found = []
    for begin in range(0, len(members), TOGETHER):
        columns = np.concatenate([one.values for one in members[begin : begin + TOGETHER]], axis=2)
        size = members[0].values.shape[2]
        before = (columns**2).sum(axis=(0, 1)).reshape(-1, size)
        flat = beside(columns).reshape(left.size, -1)
        score = (flat.T @ left.ravel()).reshape(-1, size)
        each = flat.reshape(left.size, -1, size).transpose(1, 0, 2)
        gram = each.transpose(0, 2, 1) @ each
        # what the basis explains to one part in 1e6 is not this description's
        gram += np.eye(size) * (1e-6 * before[:, :, None] + 1e-12)
        found.append((score * np.linalg.solve(gram, score[:, :, None])[:, :, 0]).sum(axis=1))
    return np.concatenate(found)


def held_out_losses(evidence: Evidence, basis: Block, searched: Sequence[Searched]) -> FloatArray:
    """(K,) mean square left in left-out rows by `basis` and each description, in squares of the noise."""
    total, places = sums(replace(evidence, always=basis), [one.block for one in searched])
    held = np.arange(basis.values.shape[2])
    counts = np.array([total.learnable(place) for place in places])
    return total.held_out([np.concatenate([held, place]) for place in places], counts)


def ranked(
    searched: Sequence[Searched],
    losses: FloatArray,
    base: float,
    evidence: Evidence,
    basis: Block,
    noise_um: float,
    least_gain: float,
    links: int,
) -> tuple[Dependence, ...]:
    """One entry per covariate, the one that explains most first; only those that explain enough not to be chance.

    base : mean square left by `basis` alone, held out.  least_gain : what is worth a line, in squares of the noise.
    """
    order = [int(k) for k in np.argsort(losses) if np.isfinite(losses[k])]
    if not order:
        return ()
    first: dict[str, int] = {}
    for k in order:
        first.setdefault(searched[k].description.covariate, k)
    beside = Projection(basis.values)
    columns = [beside(searched[k].values) for k in order]
    y = beside(evidence.y)
    left = Projection(columns[0])(y)
    chance = dict(zip(order, chances([[one] for one in columns], y, left, evidence.group), strict=True))
    found = []
    for k in first.values():
        gain = base - losses[k]
        if gain >= least_gain and chance[k] <= SIGNIFICANT:
            explained = min(gain / max(base - 1.0, gain), 1.0)
            rms_um = noise_um * float(np.sqrt(max(losses[k], 0.0)))
            found.append(_dependence(searched[k], evidence, basis, chance[k], explained, rms_um, links))
    return tuple(found)


def _dependence(
    one: Searched, evidence: Evidence, basis: Block, chance: float, explained: float, rms_um: float, links: int
) -> Dependence:
    """With the numbers fitted on all rows, and the directions that matter."""
    total, places = sums(replace(evidence, always=basis), [one.block])
    held = np.arange(basis.values.shape[2])
    theta = total.fitted(np.concatenate([held, places[0]]))[0][len(held) :]
    names = [column.name for column in one.effect.columns(links)]
    parts: list[tuple[float, dict[str, Any], dict[str, float]]] = []
    for place, axis in enumerate(one.description.axes):
        here = slice(place * len(names), (place + 1) * len(names))
        numbers = dict(zip(names, theta[here].tolist(), strict=True))
        sizes = {
            parameter.name: max(abs(v) for n, v in numbers.items() if n.split("_")[0] == parameter.name)
            for parameter in one.effect.parameters
        }
        power = float(((one.values[:, :, here] @ theta[here]) ** 2).sum())
        parts.append((power, one.description.declaration(axis, one.constant, sizes), numbers))
    parts.sort(key=lambda part: -part[0])
    kept = [part for part in parts if part[0] >= LEAST_SHARE * sum(part[0] for part in parts)]
    return Dependence(
        one.description.covariate, one.description.form, one.description.port, float(chance), float(explained), rms_um,
        tuple(part[1] for part in kept), tuple(part[2] for part in kept),
    )  # fmt: skip
