"""The numbers by which rows are divided and weighed, sets of effects searched, and measurements proposed."""

from __future__ import annotations

from dataclasses import dataclass

from compd.threshold import threshold


@dataclass(frozen=True)
class SearchCriteria:
    """How far the search for a set of effects goes."""

    max_rows: int = threshold(
        5000,
        unit="rows",
        meaning="a longer recording is thinned evenly to so many",
        reason="effects of a fiftieth of the noise still show in them",
    )
    max_members: int = threshold(
        9,
        unit="effects and descriptions",
        meaning="a set has so many members at most",
        reason="a choice: it bounds the time; the price of each ends a search before",
    )
    further_members: int = threshold(
        2,
        unit="effects and descriptions",
        meaning="by so many members more the search goes on without a gain",
        reason="two effects may gain only together",
    )
    max_ranked: int = threshold(
        400,
        unit="sets",
        meaning="so many, the best first, are examined for one that is plausible",
        reason="a choice: it bounds the time; one that is plausible is most often among the first ten",
    )
    refinements: int = threshold(
        2,
        unit="rounds",
        meaning="so often the constants of a set are refined between neighbouring values",
        reason="a factor of two becomes 1.15, then 1.03",
    )
    promising_changes: int = threshold(
        6,
        unit="effects",
        meaning="so many effects that may have changed compete, each at its best moment: those that score best where "
        "they were fitted",
        reason="a choice: more than these explain nearly the same",
    )
    sign_flips: int = threshold(
        999,
        unit="resamples",
        meaning="p-values rest on so many",
        reason="the smallest p-value that can be stated is then 1 / 1000",
    )
    place_share: float = threshold(
        0.9,
        unit="share of a column's variance",
        meaning="an effect of which so much is between places is compared with what is left from place to place",
        reason="a choice: within a place it changes with weather, load or direction, of which repeats say enough",
    )


@dataclass(frozen=True)
class FoldCriteria:
    """Which rows are left out together, to be predicted by the others."""

    min_sessions: int = threshold(
        3,
        unit="sessions",
        meaning="of fewer, blocks of time are left out in their place",
        reason="of two sessions, one would have to predict the other",
    )
    blocks: int = threshold(
        8,
        unit="blocks of time, or classes of values",
        meaning="into so many the rows are divided, of equally many rows each",
        reason="a choice: an eighth left out leaves most of what the others say of it, and is longer than a stretch of "
        "correlated rows",
    )
    max_folds: int = threshold(
        24,
        unit="folds",
        meaning="of more sessions neighbours are left out together",
        reason="memory grows with the folds, and what is learned hardly changes",
    )
    sectors: int = threshold(
        5,
        unit="sectors",
        meaning="into so many the workspace is divided",
        reason="a fifth left out leaves four fifths to learn from",
    )
    same_place_share: float = threshold(
        0.01,
        unit="share of an axis's extent",
        meaning="places nearer to each other are one; an axis along which the tip moves by less of the longest one "
        "is none of the workspace",
        reason="a choice: a target is visited again within far less",
    )
    confounded_share: float = threshold(
        0.3,
        unit="share of the variance",
        meaning="where a place or a setting varies by less within blocks of time, each fold gets a part of every block",
        reason="a choice: most of what is varied goes with the block then, and a block left out lies beyond the others",
    )
    max_values: int = threshold(
        12,
        unit="different values",
        meaning="a column named in `folds:` that has more is divided into classes of equally many rows",
        reason="a choice: a setting has fewer, a reading has more",
    )


@dataclass(frozen=True)
class GrossCriteria:
    """Which rows are gross beside everything that could explain them; `Criteria.gross_sigmas` says how far off."""

    exponent: float = threshold(
        2.0,
        unit="1",
        meaning="exponent of Huber's weight in the fit beside which rows are judged",
        reason="a choice: with 1, many columns at once can follow gross rows",
    )
    ridge: float = threshold(
        1e-4,
        unit="share of each column's squared norm",
        meaning="holds the numbers of that fit near 0",
        reason="a choice: there may be more columns than rows determine",
    )
    max_columns_share: float = threshold(
        0.4,
        unit="share of the measured values",
        meaning="with more columns than this, rows are judged beside a constant alone",
        reason="a choice: a fit of so many says nothing of single rows",
    )
    min_in_run: int = threshold(
        4,
        unit="gross rows",
        meaning="so many close together are told as a run: something happened there",
        reason="a choice: three in a row happen by chance in long recordings",
    )
    max_gap: int = threshold(
        3,
        unit="rows",
        meaning="gross rows that are farther apart are in different runs",
        reason="a choice: two good rows may lie between",
    )
