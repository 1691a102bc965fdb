"""What a residual depends on: every covariate at every port in every form, judged on rows that were left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.diagnosis.candidates import SEARCH_COUNTS, Candidate
from compd.diagnosis.empirical_terms import EmpiricalTerm, descriptions, finer
from compd.diagnosis.regression import Block, Evidence, sums
from compd.diagnosis.selection import PER_NUMBER
from compd.diagnosis.significance import Projection, chances
from compd.diagnosis.whitening import Whitening
from compd.model.effect import Effect

# Places between neighbours of a grid that are tried for a step, a knee or a period.
FINER = 9
# A direction with a smaller share of what a description explains is left out of the proposal.
LEAST_SHARE = 0.03
# Descriptions that are judged on left-out rows, of those that explain most where they were fitted.
PROMISING = 60
# A number more must explain so much of what is above the floor: a curve fits a line's noise a little better, and
# that of a covariate which only goes along. Between forms of one covariate less will do.
PLAIN_SHARE = 0.01
FORM_SHARE = 0.002
# Two covariates must take away so much of what the best one alone leaves above the floor.
LEAST_MORE = 0.5
# So many are computed at once: a balance of memory and overhead.
TOGETHER = 64
# A chance above this is no finding.
SIGNIFICANT = 0.05


@dataclass(frozen=True, eq=False)
class EmpiricalFit:
    """A description at one value of its shape constant: values (R, m, P) whitened, on the rows of the evidence."""

    description: EmpiricalTerm
    effect: Effect
    constant: float | None
    values: FloatArray

    @property
    def numbers(self) -> int:
        """How many it takes, its constant with them."""
        return int(self.values.shape[2]) + SEARCH_COUNTS * (self.constant is not None)

    @property
    def block(self) -> Block:
        """Of its numbers nothing is known."""
        return Block(self.values, np.full(self.values.shape[2], np.inf))

    def candidate(self, columns_um: FloatArray) -> Candidate:
        """As a competitor of the library's effects."""
        name = f"{self.description.covariate} {self.description.form}"
        shape = {self.description.constant: self.constant} if self.constant is not None else {}
        limits = np.tile([-np.inf, np.inf], (columns_um.shape[2], 1))
        return Candidate(name, self.effect, shape, columns_um, limits, SEARCH_COUNTS * len(shape))


@dataclass(frozen=True)
class EmpiricalFinding:
    """One thing that the residual follows.

    explained_fraction : of what is above the noise, on rows that were left out.
    formula_effects : ready to paste; the first is the largest.  numbers : their fitted numbers.
    beside : another covariate that is needed along with it.
    """

    covariate: str
    form: str
    port: str
    p_adjusted: float
    explained_fraction: float
    heldout_rms_um: float
    formula_effects: tuple[dict[str, Any], ...]
    numbers: tuple[dict[str, float], ...]
    beside: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """The keys of the verdict's `depends_on`."""
        return {
            "covariate": self.covariate,
            "form": self.form,
            "port": self.port,
            "p_adjusted": self.p_adjusted,
            "explained_fraction": self.explained_fraction,
            "heldout_rms_um": self.heldout_rms_um,
            "formula_effect": self.formula_effects[0],
            "formula_effects": list(self.formula_effects),
            "fitted": list(self.numbers),
            "beside": list(self.beside),
            "note": "a description, not a cause",
        }


class Everything:
    """Every description on a recording, at every value of its shape constant, as one table of columns."""

    def __init__(self, whiten: Whitening) -> None:
        self._whiten = whiten
        by_size: dict[int, list[EmpiricalFit]] = {}
        for description in descriptions(whiten.aligned):
            effect = description.effect()
            for constant in description.grid or (None,):
                values = whiten(whiten.columns_um(description, effect, constant))
                if np.isfinite(values).all() and values.any():
                    by_size.setdefault(values.shape[2], []).append(EmpiricalFit(description, effect, constant, values))
        self._by_size = by_size

    def best(self, y: FloatArray, basis: FloatArray) -> list[EmpiricalFit]:
        """Each description at its best constant beside `basis` (R, m, Q), the PROMISING ones that explain most of y.

        Steps, knees and periods are then looked for more finely.
        """
        beside = Projection(basis)
        left = beside(y)
        best: dict[EmpiricalTerm, tuple[float, EmpiricalFit]] = {}
        for members in self._by_size.values():
            for one, explained in zip(members, _explained(members, left, beside).tolist(), strict=True):
                if one.description not in best or explained > best[one.description][0]:
                    best[one.description] = explained, one
        order = sorted(best.values(), key=lambda pair: -pair[0])[:PROMISING]
        return [self._finer(one, left, beside) for _, one in order]

    def _finer(self, one: EmpiricalFit, left: FloatArray, beside: Projection) -> EmpiricalFit:
        if one.constant is None or one.description.form not in ("step", "knee", "periodic"):
            return one
        around = [one]
        for value in finer(one.description, one.constant, FINER):
            values = self._whiten(self._whiten.columns_um(one.description, one.effect, value))
            around.append(replace(one, constant=value, values=values))
        return around[int(np.argmax(_explained(around, left, beside)))]


def _explained(members: Sequence[EmpiricalFit], left: FloatArray, beside: Projection) -> FloatArray:
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


def held_out_losses(evidence: Evidence, basis: Block, searched: Sequence[EmpiricalFit]) -> FloatArray:
    """(K,) mean square left in left-out rows by `basis` and each description, in squares of the noise."""
    total, places = sums(replace(evidence, always=basis), [one.block for one in searched])
    held = np.arange(basis.values.shape[2])
    counts = np.array([total.learnable(place) for place in places])
    return total.held_out([np.concatenate([held, place]) for place in places], counts)


def by_covariate(losses: FloatArray, searched: Sequence[EmpiricalFit], left: float) -> list[int]:
    """The best description of each covariate that can be tested, the best covariate first.

    left : mean square without any of them.
    """
    known = [k for k in range(len(searched)) if np.isfinite(losses[k])]
    best: dict[str, int] = {}
    for share in (PLAIN_SHARE, FORM_SHARE):  # the second, of the covariates in the order of the first
        price = PER_NUMBER + share * max(left - 1.0, 0.0)
        found: dict[str, int] = {}
        for k in sorted(known, key=lambda k: losses[k] + price * searched[k].numbers):
            found.setdefault(searched[k].description.covariate, k)
        best = {name: found[name] for name in best} if best else found
    return list(best.values())


class Rest(NamedTuple):
    """What is to be described: the evidence beside `held` (R, m, Q), which leaves `left`, held out.

    noise_um : the floor.  least_gain : what is worth a line, in squares of the noise.  links : of the machine.
    """

    evidence: Evidence
    held: Block
    left: float
    noise_um: float
    least_gain: float
    links: int

    def rms_um(self, loss: float) -> float:
        """Per coordinate, from a mean square in squares of the noise."""
        return self.noise_um * float(np.sqrt(max(loss, 0.0)))

    def explained(self, loss: float) -> float:
        """Share of what is above the noise."""
        return float(min((self.left - loss) / max(self.left - 1.0, self.left - loss), 1.0))


def ranked(rest: Rest, searched: Sequence[EmpiricalFit], losses: FloatArray) -> tuple[EmpiricalFinding, ...]:
    """One entry per covariate, the one that explains most first; only those that explain enough not to be chance."""
    first = by_covariate(losses, searched, rest.left)
    if not first:
        return ()
    order = [*first, *(k for k in range(len(searched)) if np.isfinite(losses[k]) and k not in first)]
    chance = _chances(rest, [[searched[k]] for k in order])
    by_place = dict(zip(order, chance, strict=True))
    return tuple(
        _dependence(rest, [searched[k]], by_place[k], float(losses[k]))
        for k in first
        if rest.left - losses[k] >= rest.least_gain and by_place[k] <= SIGNIFICANT
    )


def together(rest: Rest, searched: Sequence[EmpiricalFit], alone: float) -> tuple[EmpiricalFinding, ...]:
    """The two descriptions that explain most together, where that is much more than the best one does alone.

    alone : mean square that the best one leaves.
    """
    pairs = [
        (a, b)
        for a, b in combinations(range(len(searched)), 2)
        if searched[a].description.covariate != searched[b].description.covariate
    ]
    total, places = sums(replace(rest.evidence, always=rest.held), [one.block for one in searched])
    held = np.arange(rest.held.values.shape[2])
    learnable = np.array([total.learnable(place) for place in places])
    sets = [np.concatenate([held, places[a], places[b]]) for a, b in pairs]
    losses = total.held_out(sets, np.array([learnable[a] & learnable[b] for a, b in pairs]))
    if not np.isfinite(losses).any():
        return ()
    best = int(np.nanargmin(losses))
    pair = [searched[k] for k in pairs[best]]
    excess = max(float(losses[best]) - 1.0, 0.0)
    if alone - losses[best] < rest.least_gain or alone - 1.0 < excess / (1 - LEAST_MORE):
        return ()
    chance = _chances(rest, [pair])[0]
    return (_dependence(rest, pair, chance, float(losses[best])),) if chance <= SIGNIFICANT else ()


def _chances(rest: Rest, families: Sequence[Sequence[EmpiricalFit]]) -> list[float]:
    """Of each family's columns together; the first is taken to be the explanation when the noise is flipped."""
    beside = Projection(rest.held.values)
    columns = [beside(np.concatenate([one.values for one in family], axis=2)) for family in families]
    y = beside(rest.evidence.y)
    left = Projection(columns[0])(y)
    found: list[float] = chances([[one] for one in columns], y, left, rest.evidence.group).tolist()
    return found


def _dependence(rest: Rest, described: Sequence[EmpiricalFit], chance: float, loss: float) -> EmpiricalFinding:
    """With the numbers fitted on all rows, and the directions that matter; the first covariate is the larger part."""
    total, places = sums(replace(rest.evidence, always=rest.held), [one.block for one in described])
    theta, _, _ = total.fitted(np.concatenate([np.arange(rest.held.values.shape[2]), *places]))
    parts: list[tuple[float, str, dict[str, Any], dict[str, float]]] = []
    for one, place in zip(described, places, strict=True):
        names = [column.name for column in one.effect.columns(rest.links)]
        for number, axis in enumerate(one.description.axes):
            here = slice(number * len(names), (number + 1) * len(names))
            values = theta[place][here]
            numbers = dict(zip(names, values.tolist(), strict=True))
            sizes = {
                parameter.name: max(abs(v) for n, v in numbers.items() if n.split("_")[0] == parameter.name)
                for parameter in one.effect.parameters
            }
            power = float(((one.values[:, :, here] @ values) ** 2).sum())
            declared = one.description.declaration(axis, one.constant, sizes)
            parts.append((power, one.description.covariate, declared, numbers))
    parts.sort(key=lambda part: -part[0])
    kept = [part for part in parts if part[0] >= LEAST_SHARE * sum(part[0] for part in parts)]
    main = next(one for one in described if one.description.covariate == parts[0][1]).description
    return EmpiricalFinding(
        main.covariate,
        main.form,
        main.port,
        chance,
        rest.explained(loss),
        rest.rms_um(loss),
        tuple(part[2] for part in kept),
        tuple(part[3] for part in kept),
        tuple(one.description.covariate for one in described if one.description.covariate != main.covariate),
    )
