"""Where the model fails, in words with numbers: what the residual follows, and in which part of the workspace."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import t as t_distribution

from compd.arrays import BoolArray, FloatArray, IntArray
from compd.comparison.aligned_recording import AlignedRecording
from compd.comparison.cluster_covariance import neighbour_blocks
from compd.comparison.noise_floor import NoiseFloor
from compd.units import unit_of

# Below this share of a coordinate's variation, or this chance after correction for the number of looks, say nothing.
LEAST_EXPLAINED = 0.05
CHANCE = 0.01
# A coordinate whose mean square is within this factor of the floor has nothing to explain.
QUIET = 1.2
# Two covariates this much alike cannot be told apart: both are named.
ALIKE = 0.95
# A part of the workspace in which the error is this much larger is worth naming.
MUCH_LARGER = 1.4
PER_COORDINATE = 2
ROWS = 10_000
ENDS = {
    "x": ("towards -x", "towards +x"),
    "y": ("towards -y", "towards +y"),
    "z": ("at the bottom of the workspace", "at the top of the workspace"),
    "time": ("at the start", "at the end"),
}


class Covariate(NamedTuple):
    """Something that the residual may follow: values (N,), nan where unknown; a direction is -1 or +1.

    link : the link it belongs to, counted from 1, 0 for none.
    """

    name: str
    unit: str
    values: FloatArray
    link: int = 0


@dataclass(frozen=True)
class Trend:
    """One thing that one coordinate of the residual follows.

    coordinate : "x" or "link 2".  covariate : what it follows; None for a constant offset.
    slope : um per unit; of a direction, the jump in um; of an offset, um.  explained : share of the variation, 0 to 1.
    alike : other covariates that say the same on these rows.  largest : where the error is largest, "" for everywhere.
    """

    coordinate: str
    covariate: str | None
    unit: str
    slope: float
    explained: float
    p_adjusted: float
    alike: tuple[str, ...] = ()
    largest: str = ""

    @property
    def text(self) -> str:
        """A sentence for a person."""
        if self.covariate is None:
            said = f"{self.coordinate} is off by {self.slope:+.2g} um everywhere"
        elif self.covariate.startswith("direction"):
            said = f"{self.coordinate} error jumps by {self.slope:+.2g} um with the {self.covariate}"
        else:
            said = f"{self.coordinate} error follows {self.covariate}, {self.slope:+.2g} um/{self.unit}"
        if self.covariate is not None:
            said += f" ({100 * self.explained:.0f} % of its variation)"
        if self.alike:
            said += f"; {', '.join(self.alike)} went the same way"
        return said + (f", and is largest {self.largest}" if self.largest else "")

    def as_json(self) -> dict[str, Any]:
        """Numbers beside the sentence."""
        return {
            "coordinate": self.coordinate,
            "covariate": self.covariate,
            "slope_um_per_unit": self.slope,
            "unit": self.unit,
            "explained_fraction": self.explained,
            "p_adjusted": self.p_adjusted,
            "alike": list(self.alike),
            "largest": self.largest,
            "text": self.text,
        }


def covariates(aligned: AlignedRecording) -> list[Covariate]:
    """Time, place, every measured quantity, and each link's length and direction."""
    recording = aligned.recording
    found = [Covariate("time", "h", recording.time_s / 3600.0)]
    for axis, column in zip("xyz", aligned.rows.tip_M_mm.T, strict=True):
        if np.isfinite(column).any():
            found.append(Covariate(axis, "mm", column))
    for name, column in recording.quantities.items():
        unit = unit_of(name)
        found.append(Covariate(name.removesuffix(f"_{unit}"), _shown(unit), column, _link_of(name)))
    for top in [name for name in recording.quantities if name.endswith("_top_degC")]:
        bottom = top.replace("_top_", "_bottom_")
        if bottom in recording.quantities:
            name = f"{top.removesuffix('_degC')} - {bottom.removesuffix('_degC')}"
            found.append(Covariate(name, "K", recording.quantities[top] - recording.quantities[bottom]))
    for i, length in enumerate(aligned.rows.link_mm.T, start=1):
        found.append(Covariate(f"length of link {i}", "mm", length, i))
    if recording.approach is not None:
        for i, direction in enumerate(recording.approach.T, start=1):
            found.append(Covariate(f"direction of link {i}", "1", direction, i))
    return found


def find_trends(
    aligned: AlignedRecording, residual_um: FloatArray, links_um: FloatArray | None, used: BoolArray, floor: NoiseFloor
) -> tuple[Trend, ...]:
    """What each coordinate of the residual follows, the strongest first; nothing where it is at the floor.

    residual_um : (N, m).  links_um : (N, n), the same as errors of link lengths, or None.
    One coordinate at a time, straight lines only, tested on blocks of neighbouring rows: a first look, not a proof.
    """
    used = _thinned(used)
    coordinates = [(label, residual_um[:, k], float(floor.by_axis_um[k])) for k, label in enumerate(aligned.labels)]
    if links_um is not None:
        # noise at the tip, seen through the same Jacobian as the residual, is as much smaller at the links
        share = np.sqrt(np.mean(links_um[used] ** 2, axis=0)) / max(
            float(np.sqrt(np.mean(residual_um[used] ** 2))), 1e-12
        )
        coordinates += [(f"link {i + 1}", column, float(share[i] * floor.um)) for i, column in enumerate(links_um.T)]
    all_covariates = covariates(aligned)
    group = neighbour_blocks(aligned.recording)
    looks = len(coordinates) * len(all_covariates)
    found: list[tuple[float, Trend]] = []
    for label, values, floor_um in coordinates:
        if np.mean(values[used] ** 2) <= QUIET * floor_um**2:
            continue
        own = int(label.removeprefix("link ")) if label.startswith("link") else 0
        candidates = [one for one in all_covariates if not own or one.link in (0, own)]
        found += _follow(label, values, used, candidates, group, looks, _largest(aligned, values, used))
    found.sort(key=lambda pair: -pair[0])
    return _clearest([finding for _, finding in found])


def _thinned(used: BoolArray) -> BoolArray:
    """At most ROWS of the rows, evenly spread: more would not change what is said."""
    rows = np.flatnonzero(used)
    chosen = np.zeros_like(used)
    chosen[rows[np.linspace(0, len(rows) - 1, min(ROWS, len(rows))).astype(np.int64)]] = True
    return chosen


def _clearest(found: list[Trend]) -> tuple[Trend, ...]:
    """A link is named only for what it shows more clearly than the tip does."""
    at_tip: dict[str | None, float] = {}
    for one in found:
        if not one.coordinate.startswith("link"):
            at_tip[one.covariate] = max(one.explained, at_tip.get(one.covariate, 0.0))
    return tuple(
        one for one in found if not one.coordinate.startswith("link") or one.explained > at_tip.get(one.covariate, 0.0)
    )


def _follow(
    label: str,
    values: FloatArray,
    used: BoolArray,
    candidates: list[Covariate],
    group: IntArray,
    looks: int,
    largest: str,
) -> list[tuple[float, Trend]]:
    """One coordinate: what it follows, then what the rest follows; each with the squares (um^2) that it explains."""
    found: list[tuple[float, Trend]] = []
    mean = float(values[used].mean())
    rest = values - mean
    std = _mean_std(rest[used], group[used])
    p = _chance(mean / std, len(np.unique(group[used])), looks) if std > 0 else 1.0
    if p < CHANCE and mean**2 > LEAST_EXPLAINED * float(np.mean(values[used] ** 2)):
        explained = mean**2 / float(np.mean(values[used] ** 2))
        found.append((mean**2, Trend(label, None, "", mean, explained, p)))
    total = float(np.mean(rest[used] ** 2))
    for _ in range(PER_COORDINATE):
        best = max((_line(one, rest, used, group) for one in candidates), key=lambda line: line.explained, default=None)
        if best is None or best.explained * float(np.mean(rest[used] ** 2)) < LEAST_EXPLAINED * total:
            break
        p = _chance(best.t, best.blocks, looks)
        if p >= CHANCE:
            break
        of_all = best.explained * float(np.mean(rest[used] ** 2)) / total
        one = best.covariate
        slope = 2 * best.slope if one.name.startswith("direction") else best.slope
        alike = tuple(other.name for other in candidates if other is not one and _likeness(one, other, used) > ALIKE)
        found.append((of_all * total, Trend(label, one.name, one.unit, slope, of_all, p, alike[:4], largest)))
        largest = ""  # once per coordinate is enough
        rest = rest - best.slope * (np.nan_to_num(one.values - np.nanmean(one.values[used])))
    return found


class _Line(NamedTuple):
    covariate: Covariate
    slope: float
    explained: float
    t: float
    blocks: int


def _line(one: Covariate, values: FloatArray, used: BoolArray, group: IntArray) -> _Line:
    """Straight line through the rows that have the covariate; t from sums over blocks of neighbouring rows."""
    rows = used & np.isfinite(one.values)
    nothing = _Line(one, 0.0, 0.0, 0.0, 0)
    if rows.sum() < 10:
        return nothing
    x = one.values[rows] - one.values[rows].mean()
    y = values[rows] - values[rows].mean()
    squares = float(x @ x)
    spread = float(np.sqrt(squares / len(x)))
    if spread < 1e-9 * max(1.0, float(np.abs(one.values[rows]).max())):
        return nothing
    slope = float(x @ y) / squares
    left = y - slope * x
    explained = 1.0 - float(left @ left) / max(float(y @ y), 1e-300)
    sums = np.bincount(group[rows], x * left)
    blocks = len(np.unique(group[rows]))
    naive = float(left @ left) / max(len(x) - 2, 1) / squares
    clustered = float(sums @ sums) / squares**2 * blocks / max(blocks - 1, 1)
    std = np.sqrt(max(naive, clustered))
    return _Line(one, slope, explained, slope / std if std > 0 else np.inf, blocks)


def _mean_std(rest: FloatArray, group: IntArray) -> float:
    """Standard error of the mean, from sums over blocks."""
    sums = np.bincount(group, rest)
    blocks = max(len(np.unique(group)), 2)
    naive = float(np.mean(rest**2)) / len(rest)
    clustered = float(sums @ sums) / len(rest) ** 2 * blocks / (blocks - 1)
    return float(np.sqrt(max(naive, clustered)))


def _chance(t: float, blocks: int, looks: int) -> float:
    """Chance of so large a t by noise alone, in so many looks (Bonferroni)."""
    return float(min(1.0, 2.0 * t_distribution.sf(abs(t), max(blocks - 1, 1)) * looks))


def _likeness(one: Covariate, other: Covariate, used: BoolArray) -> float:
    """Correlation of two covariates, 0 to 1."""
    rows = used & np.isfinite(one.values) & np.isfinite(other.values)
    a, b = one.values[rows], other.values[rows]
    if len(a) < 10 or np.ptp(a) == 0 or np.ptp(b) == 0:
        return 0.0
    return float(abs(np.corrcoef(a, b)[0, 1]))


def _largest(aligned: AlignedRecording, values: FloatArray, used: BoolArray) -> str:
    """The end of the workspace, or of the recording, at which the error is much larger than at the other end."""
    best, said = MUCH_LARGER, ""
    places = {"time": aligned.recording.time_s}
    places |= dict(zip("xyz", aligned.rows.tip_M_mm.T, strict=True))
    for name, place in places.items():
        rows = used & np.isfinite(place)
        if rows.sum() < 30 or np.ptp(place[rows]) == 0:
            continue
        low, high = np.quantile(place[rows], [1 / 3, 2 / 3])
        ends = [rows & (place <= low), rows & (place >= high)]
        size = [float(np.sqrt(np.mean(values[end] ** 2))) for end in ends]
        for k in range(2):
            if size[k] > best * max(size[1 - k], 1e-12):
                best = size[k] / max(size[1 - k], 1e-12)
                said = f"{ENDS[name][k]} ({size[k]:.2g} um rms, {size[1 - k]:.2g} um at the other end)"
    return said


def _link_of(name: str) -> int:
    """The link that a quantity belongs to, by its name; 0 for none."""
    parts = name.split("_")
    for before, number in pairwise(parts):
        if before == "link" and number.isdigit():
            return int(number)
    return 0


def _shown(unit: str) -> str:
    """A difference of temperatures is in kelvins."""
    return {"degC": "K", "pct": "%", "": "1"}.get(unit, unit)
