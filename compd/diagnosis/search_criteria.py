"""The numbers by which rows are divided and weighed, sets of effects searched, and measurements proposed."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchCriteria:
    """How far the search for a set of effects goes."""

    max_rows: int = 5000
    """rows | a longer recording is thinned evenly to so many | effects of a fiftieth of the noise still show in them"""
    max_members: int = 9
    """effects and descriptions | a set has so many members at most | a choice: it bounds the time; the price of each
    ends a search before"""
    further_members: int = 2
    """effects and descriptions | by so many members more the search goes on without a gain | two effects may gain only
    together"""
    max_ranked: int = 400
    """sets | so many, the best first, are examined for one that is plausible | a choice: it bounds the time; one that
    is plausible is most often among the first ten"""
    refinements: int = 2
    """rounds | so often the constants of a set are refined between neighbouring values | a factor of two becomes 1.15,
    then 1.03"""
    promising_changes: int = 6
    """effects | so many effects that may have changed compete, each at its best moment: those that score best where
    they were fitted | a choice: more than these explain nearly the same"""
    sign_flips: int = 999
    """resamples | p-values rest on so many | the smallest p-value that can be stated is then 1 / 1000"""
    place_share: float = 0.9
    """share of a column's variance | an effect of which so much is between places is compared with what is left from
    place to place | a choice: within a place it changes with weather, load or direction, of which repeats say enough"""


@dataclass(frozen=True)
class FoldCriteria:
    """Which rows are left out together, to be predicted by the others."""

    min_sessions: int = 3
    """sessions | of fewer, blocks of time are left out in their place | of two sessions, one would have to predict the
    other"""
    blocks: int = 8
    """blocks of time, or classes of values | into so many the rows are divided, of equally many rows each | a choice:
    an eighth left out leaves most of what the others say of it, and is longer than a stretch of correlated rows"""
    max_folds: int = 24
    """folds | of more sessions neighbours are left out together | memory grows with the folds, and what is learned
    hardly changes"""
    sectors: int = 5
    """sectors | into so many the workspace is divided | a fifth left out leaves four fifths to learn from"""
    same_place_share: float = 0.01
    """share of an axis's extent | places nearer to each other are one; an axis along which the tip moves by less of the
    longest one is none of the workspace | a choice: a target is visited again within far less"""
    confounded_share: float = 0.3
    """share of the variance | where a place or a setting varies by less within blocks of time, each fold gets a part of
    every block | a choice: most of what is varied goes with the block then, and a block left out lies beyond the
    others"""
    max_values: int = 12
    """different values | a column named in `folds:` that has more is divided into classes of equally many rows | a
    choice: a setting has fewer, a reading has more"""


@dataclass(frozen=True)
class GrossCriteria:
    """Which rows are gross beside everything that could explain them; `Criteria.gross_sigmas` says how far off."""

    exponent: float = 2.0
    """1 | exponent of Huber's weight in the fit beside which rows are judged | a choice: with 1, many columns at once
    can follow gross rows"""
    ridge: float = 1e-4
    """share of each column's squared norm | holds the numbers of that fit near 0 | a choice: there may be more columns
    than rows determine"""
    max_columns_share: float = 0.4
    """share of the measured values | with more columns than this, rows are judged beside a constant alone | a choice: a
    fit of so many says nothing of single rows"""
    min_in_run: int = 4
    """gross rows | so many close together are told as a run: something happened there | a choice: three in a row happen
    by chance in long recordings"""
    max_gap: int = 3
    """rows | gross rows that are farther apart are in different runs | a choice: two good rows may lie between"""
