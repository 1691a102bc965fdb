"""Which physical effect is missing: from a recording and a model to a verdict with its evidence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from compd.errors import CompdError
from compd.model.effect import Effect, Fitted
from compd.workbench.adequacy import MOST_LEFT, Number, at_floor, cost, explained_fraction, numbers, untestable
from compd.workbench.ambiguity import Rival, rivals, simplest
from compd.workbench.candidates import UM_PER_MM, Candidate, Pool, library_pool
from compd.workbench.compare import Comparison, compare
from compd.workbench.contest import Contest, Members
from compd.workbench.dependence import Dependence, Everything, Searched, Whitener, held_out_losses, ranked
from compd.workbench.evidence import Block, Evidence
from compd.workbench.fit import blocks_of, start
from compd.workbench.folds import schemes
from compd.workbench.observed import Observed
from compd.workbench.recording import BoolArray
from compd.workbench.screening import outliers
from compd.workbench.search import search
from compd.workbench.significance import Projection, chances
from compd.workbench.table import FloatArray

# Descriptions that compete with the library's effects: the best of so many covariates, beside each basis.
COMPETING = 4
# A chance above this is no finding.
SIGNIFICANT = 0.05

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Step:
    """One effect found. heldout_rms_um : with it and those before; explained_fraction : of what they left."""

    fitted: Fitted
    rivals: tuple[Rival, ...]
    heldout_rms_um: float
    explained_fraction: float
    p_adjusted: float
    numbers: tuple[Number, ...]


@dataclass(frozen=True, eq=False)
class Judged:
    """One candidate alone, and why it is named or not."""

    effect: str
    status: str
    why: str
    heldout_rms_um: float
    explained_fraction: float
    p_adjusted: float
    numbers: tuple[Number, ...]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The verdict and everything that led to it.

    before, after : the recording against the model as it was, and with the steps' effects.
    """

    verdict: str
    before: Comparison
    after: Comparison
    steps: tuple[Step, ...]
    candidates: tuple[Judged, ...]
    depends_on: tuple[Dependence, ...]


def diagnose(
    seen: Observed,
    fitted: Sequence[Fitted],
    covariance: FloatArray | None,
    effects: Sequence[Effect],
    progress: Progress = lambda said: None,
) -> Diagnosis:
    """Learn which effects the model lacks on this recording.

    fitted, covariance : the model's effects, refitted along.  effects : the library.  progress : told what begins.
    Raises CompdError as `compare` does.
    """
    progress("comparing the model with the recording")
    before = compare(seen, fitted, covariance)
    progress("columns of every effect")
    pool = library_pool(seen, effects, [one.effect.id for one in fitted])
    outlier = None
    for _ in range(3):
        bench = _bench(before, fitted, pool, outlier)
        progress("every effect, pair and triple on left-out rows")
        found = _explain(bench, progress)
        again = bench.outliers_beside(found.members, found.contest)
        if outlier is not None and (again == outlier).all():
            break
        if (again == bench.outlier).all():
            break
        outlier = again
    progress("fitting on the real forward model")
    return _verdict(bench, found, fitted, covariance)


class Bench:
    """The whitened problem: which rows count, the evidence, the library's candidates on them."""

    def __init__(self, before: Comparison, pool: Pool, always_um: FloatArray, outlier: BoolArray | None) -> None:
        seen = before.seen
        self.before, self.seen, self.pool = before, seen, pool
        self.sigma_um = before.floor.by_axis_um
        known = np.isfinite(before.residual_um).all(axis=1) & np.isfinite(always_um).all(axis=(1, 2))
        for one in pool.candidates:
            known &= np.isfinite(one.columns_um).all(axis=(1, 2))
        self._known = known
        self._y = np.where(known[:, None], before.residual_um, 0.0) / self.sigma_um
        self._always = always_um / self.sigma_um[:, None]
        if outlier is None:
            outlier = outliers(self._y, [self._always, *self._rich()], known, seen.recording.visit)
        self.outlier = outlier
        self.rows = known & ~outlier
        self.whiten = Whitener(seen, self.rows, self.sigma_um)
        folds = tuple(_numbered(scheme[self.rows]) for scheme in schemes(seen))
        always = self._always[self.rows]
        self.evidence = Evidence(
            self._y[self.rows], folds, _numbered(blocks_of(seen.recording)[self.rows]),
            Block(always, np.full(always.shape[2], np.inf)),
        )  # fmt: skip
        self.values = [self.whiten(one.columns_um) for one in pool.candidates]

    def _rich(self) -> list[FloatArray]:
        """One variant of each effect, and every measured quantity in every direction."""
        first: dict[str, Candidate] = {}
        for one in self.pool.candidates:
            first.setdefault(one.name, one)
        columns = [one.columns_um / self.sigma_um[:, None] for one in first.values()]
        axes = len(self.seen.labels)
        time_s = self.seen.rows.time_s
        for values in (time_s, time_s**2, *self.seen.recording.quantities.values()):
            if np.isfinite(values[self._known]).all() and np.ptp(values[self._known]) > 0:
                middle = values - values[self._known].mean()
                columns.append(middle[:, None, None] / np.ptp(values[self._known]) * np.eye(axes))
        return columns

    def outliers_beside(self, members: Members, contest: Contest) -> BoolArray:
        """(N,) gross rows beside a set of candidates alone."""
        chosen = [contest.candidates[k].columns_um / self.sigma_um[:, None] for k in members]
        return outliers(self._y, [self._always, *chosen], self._known, self.seen.recording.visit)


@dataclass(frozen=True, eq=False)
class Explanation:
    """The best set: effects of the library in the order of their weight; descriptions where they are needed.

    contest : library and descriptions together.  searched : all descriptions, each at its best, beside the effects.
    """

    contest: Contest
    members: Members
    effects: Members
    described: bool
    searched: tuple[Searched, ...]


def _explain(bench: Bench, progress: Progress) -> Explanation:
    library = Contest(bench.evidence, bench.pool.candidates, bench.values)
    chosen = library.best()
    if not chosen.members and at_floor(library.base):
        return Explanation(library, (), (), False, ())
    progress("what the rest depends on")
    everything = Everything(bench.whiten)
    competing: dict[tuple[str, str, str, bool], Searched] = {}
    searched: list[Searched] = []
    for basis in dict.fromkeys([(), chosen.members[:1], chosen.members]):
        held = _held(library, basis)
        searched = everything.best(bench.evidence.y, held.values)
        losses = held_out_losses(bench.evidence, held, searched)
        covariates: list[str] = []
        for k in np.argsort(losses):
            about = searched[k].description
            if about.covariate not in covariates:
                covariates.append(about.covariate)
                competing[about.covariate, about.form, about.port, about.per_link] = searched[k]
            if len(covariates) == COMPETING:
                break
    descriptions = list(competing.values())
    contest = Contest(
        bench.evidence,
        [*bench.pool.candidates, *(one.candidate(bench.whiten.columns_um(one.description, one.effect, one.constant)) for one in descriptions)],
        [*bench.values, *(one.values for one in descriptions)],
    )
    progress("effects against descriptions")
    best = contest.best()
    effects = tuple(k for k in best.members if not contest.candidates[k].described)
    described = len(effects) < len(best.members)
    if not described:
        best = simplest(contest, best)
        effects = best.members
    return Explanation(contest, best.members, _by_weight(contest, effects), described, tuple(searched))


def _by_weight(contest: Contest, members: Members) -> Members:
    """The one first that alone leaves least, then the one that beside it leaves least."""
    order: tuple[int, ...] = ()
    while len(order) < len(members):
        rest = [k for k in members if k not in order]
        order = min(contest.entries([(*order, k) for k in rest]), key=lambda one: one.loss).members
    return order


def _held(contest: Contest, members: Members) -> Block:
    """What every fit holds, and some candidates, as one block."""
    always = contest.evidence.always
    values = [always.values, *(contest.values[k] for k in members)]
    largest = [always.largest, *(contest.candidates[k].largest for k in members)]
    return Block(np.concatenate(values, axis=2), np.concatenate(largest))


def _verdict(
    bench: Bench, found: Explanation, fitted: Sequence[Fitted], covariance: FloatArray | None
) -> Diagnosis:
    contest = found.contest
    base, noise_um = contest.base, bench.before.floor.um
    effects = found.effects
    loss = contest.entries([effects])[0].loss if effects else base
    chance = _chances(contest, effects)
    enough = explained_fraction(base, loss) >= 1 - 2 * MOST_LEFT
    if effects and not found.described and not at_floor(loss, base - 1) and not enough:
        effects = ()
    steps: list[Step] = []
    current, joint = list(fitted), covariance
    for place, k in enumerate(effects):
        candidate = contest.candidates[k]
        result = search(bench.seen, current, candidate.effect, bench.sigma_um)
        current, joint = list(result.fitted), result.covariance
    links = bench.seen.rows.links
    left = base
    for place, k in enumerate(effects):
        one = current[len(fitted) + place]
        after = contest.entries([effects[: place + 1]])[0].loss
        steps.append(
            Step(one, rivals(contest, effects, place) if not found.described else (), noise_um * np.sqrt(after),
                 explained_fraction(left, after), chance.get(contest.name(k), 1.0),
                 tuple(numbers(one.effect, links, one.theta, one.covariance)))
        )  # fmt: skip
        left = after
    after = compare(bench.seen, current, joint) if steps else bench.before
    explained = base - 1.0
    depends: tuple[Dependence, ...] = ()
    quiet = at_floor(after.floor_ratio, explained if steps else 0.0)
    if found.described or not quiet:
        held = _held(contest, effects)
        if found.searched:
            searched = found.searched
            losses = held_out_losses(bench.evidence, held, searched)
            depends = ranked(searched, losses, contest.entries([effects])[0].loss if effects else base,
                             bench.evidence, held, noise_um, cost(explained), links)  # fmt: skip
    verdict = (
        "unexplained" if found.described or not quiet
        else "adequate" if not steps
        else "ambiguous" if any(step.rivals for step in steps)
        else "identified"
    )  # fmt: skip
    return Diagnosis(verdict, bench.before, after, tuple(steps), _judged(bench, found, effects, chance, steps), depends)


def _chances(contest: Contest, effects: Members) -> dict[str, float]:
    """Each effect's chance, corrected for all; a chosen one's beside the other chosen ones."""
    beside = Projection(contest.evidence.always.values)
    values = [beside(one) for one in contest.values]
    y = beside(contest.evidence.y)
    chosen = list(effects) or [one.members[0] for one in contest.singles[:1]]
    left = Projection(np.concatenate([values[k] for k in chosen], axis=2))(y) if chosen else y
    names = list(dict.fromkeys(one.name for one in contest.candidates if not one.described))
    families = [[v for v, c in zip(values, contest.candidates, strict=True) if c.name == name] for name in names]
    return dict(zip(names, chances(families, y, left, contest.evidence.group).tolist(), strict=True))


def _judged(
    bench: Bench, found: Explanation, effects: Members, chance: Mapping[str, float], steps: Sequence[Step]
) -> tuple[Judged, ...]:
    return ()


def _numbered(values: FloatArray) -> FloatArray:
    return np.unique(values, return_inverse=True)[1]


def _bench(before: Comparison, fitted: Sequence[Fitted], pool: Pool, outlier: BoolArray | None) -> Bench:
    seen = before.seen
    columns = [seen.columns(one.effect, one.shape) * UM_PER_MM for one in fitted]
    return Bench(before, pool, np.concatenate([*columns, seen.free_columns * UM_PER_MM], axis=2), outlier)
