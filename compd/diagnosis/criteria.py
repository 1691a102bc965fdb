"""The numbers on which the verdict of a diagnosis rests, each with its meaning, its unit and where it is from.

A number is a criterion, and stands in `Criteria`, `ComparisonCriteria` or `FleetCriteria`, where another sensible value
could change a verdict, which effects are named, their numbers, the noise floor, or what a comparison says. A number
stands where it is used, beside a comment, where it is

- numerics: what rounding may do, the step or the end of an iteration, the conditioning of equations, a draw's seed;
- the definition of a method, or a constant that follows from one: a quantile of the normal distribution, the two bends
  of `trimmed_scale` with the mean square that belongs to them, three points for a frame;
- a matter of memory or time that leaves results as they are: the size of a batch or a block;
- a matter of words: how many effects a sentence names, to how many digits a formula is rounded;
- the form of a proposed measurement: at which places, loads and speeds rows are sought.

How a recording is joined, read and checked is decided before, and refused or told where it is in doubt.

tests/unit/diagnosis/test_module_numbers.py lists the numbers that stand where they are used, each with its reason.
"""

from __future__ import annotations

from dataclasses import dataclass

from compd.diagnosis.candidate_criteria import CandidateCriteria, DescriptionCriteria
from compd.diagnosis.probability_criteria import ProbabilityCriteria
from compd.diagnosis.search_criteria import FoldCriteria, GrossCriteria, SearchCriteria
from compd.planning import PlanningCriteria


@dataclass(frozen=True)
class Criteria:
    """Numbers of a verdict, handed from `diagnose` to whatever decides by them.

    A loss L is the mean square per measured value on rows that were left out, divided by the variance of the noise, so
    that 1.0 is the noise floor. A set of effects is judged by log L and the prices of its members. `thresholds` reads
    unit, meaning and reason of each. The numbers of the comparison beneath are `AlignedRecording.criteria`.

    candidates : what is tried: effects of the library, and changes in time.
    descriptions : what is tried beside them, without a cause.
    search : how sets of them are looked for.  folds : which rows are left out.  gross : which rows do not count.
    probability : how sure the named set is.  planning : which measurement is proposed.

    A stricter diagnosis, for example::

        diagnose(aligned, (), None, effects, criteria=Criteria(least_sigmas=3.0, search=SearchCriteria(max_members=3)))
    """

    effect_price: float = 0.12
    """natural logarithm of the mean square | by how much an effect must lower the logarithm of the loss: it takes 11 %
    of the mean square that is left, 6 % of the error | half of what an effect of half the noise takes: log(1 + 0.5^2) =
    0.22"""
    description_price: float = 0.25
    """natural logarithm of the mean square | the same for a description without a cause | twice an effect's: there are
    many more descriptions than effects, in any form"""
    number_price: float = 0.003
    """natural logarithm of the mean square | price of each fitted or searched number beyond a member's first | what one
    number takes of pure noise in 330 values, 1 / 330, as by Akaike's criterion; without it flexible effects win ties by
    describing what is too small to be named"""
    least_sigmas: float = 2.0
    """standard errors of the gain | each member's gain on rows left out must be so far above nought | the customary 95
    %; one standard error names what is not there, three lose effects in few sessions"""
    most_at_floor: float = 1.25
    """squares of the noise floor | up to this loss nothing worth a name is left, and nothing more is looked for; where
    the floor is from few repeats, a larger one that chance can make is no fault either if nothing is found | chance, as
    the floor is known within 5 % and 600 rows give 3 %, and two disturbances of a fifth of the floor (0.08)"""
    rival_share: float = 0.3
    """share of what the effect in its place explains | a candidate that misses more is no rival, whatever the standard
    error | a choice: rows that can tell so much can decide"""
    gross_sigmas: float = 5.0
    """robust standard deviations of the residual | a row farther off on a coordinate, which no repeat confirms, is
    gross and does not count | a normal error is as large once in two million: in no recording by chance"""
    full_weight_sigmas: float = 2.0
    """robust standard deviations of the residual | up to this, rms over the coordinates, a row counts in full; beyond
    it its weight falls as 1 / d | Huber, Robust Statistics (1981), chapter 7: 98 % efficient for a normal error of one
    coordinate"""
    range_sigmas: float = 3.0
    """standard errors | a parameter farther outside its plausible range is implausible | by noise alone once in 370
    parameters (normal distribution, two-sided)"""
    rough_factor: float = 3.0
    """times the range | a number whose range follows from the machine's stated tolerance is excluded only so far
    outside; between, it is named with a question | a choice: classes of tolerance are a factor of ten apart, and an
    owner's statement is rough"""
    excellent_share: float = 0.4
    """share of the squared error above noise | an implausible effect that alone takes so much, and more than all that
    is named, is asked about | a choice: less than half, as a second cause may hide one that is real"""
    range_slack: float = 0.25
    """share of the range's width | by so much a parameter may exceed its plausible range whatever its standard error,
    but not have the wrong sign | a choice: ranges are from handbooks, and round, and an effect of nearly the right form
    misses its number by as much"""
    bounded_price: float = 0.06
    """natural logarithm of the mean square | parameters outside their ranges are plausible where others within leave so
    little more | half an effect's price: parameters that nearly cancel are known only in their sum"""
    p_value: float = 0.05
    """probability | a description with a larger p-value, corrected for all that were tried, is not reported | the
    customary level; it comes on top of a gain on rows left out"""
    most_in_one_fold: float = 0.9
    """share of a candidate's sum of squares | a split in which one fold holds more of what a candidate does cannot test
    it | a choice: what is left in the other folds determines no parameter"""
    twin_cosine: float = 0.98
    """cosine | two effects that are more alike and have opposite signs may be one cause | a choice: a fifth of what one
    does (sin of the angle) is its own"""
    twin_share: float = 0.25
    """share of the squares of the smaller | what such effects leave of each other, below which they are no two causes |
    a choice: half of the smaller one, as an error"""
    least_alone: float = 0.25
    """squares of the noise floor | an effect that alone takes less is called likely, not identified | a choice: an
    effect of half the noise; two disturbances of a fifth of it make a third of that (0.08), and an effect with many
    numbers takes both"""
    least_beside: float = 1.0
    """squares of the noise floor | a set in which an effect takes less beside those before it is called likely, not
    identified | what a larger effect of nearly the right form leaves, another takes: of 37 sets of several effects that
    were called identified on simulated machines, 5 had one that took less, and these alone were wrong"""
    swing_share: float = 0.3
    """share of a temperature's range | by so much a temperature has to turn to count as heated or cooled again | a
    choice: less is the control of a heater, or a draught"""
    left_confidence: float = 0.9
    """probability | that the error on another day lies within the limits that are said | a choice: one day in ten
    surprises"""
    other_share: float = 0.1
    """share of the rows | a sealed recording with more of them outside what the diagnosis has seen is of other
    conditions | a choice: fewer change its error by little"""
    disturbance: float = 0.28
    """standard deviations of the noise, rms per coordinate | size of everything unnamed: in the standard errors of
    parameters, and in what named effects may leave above the floor; where nothing else is named, an effect that surely
    takes more is | a choice: two causes of a fifth of the noise each, too small to be found"""
    candidates: CandidateCriteria = CandidateCriteria()
    descriptions: DescriptionCriteria = DescriptionCriteria()
    search: SearchCriteria = SearchCriteria()
    folds: FoldCriteria = FoldCriteria()
    gross: GrossCriteria = GrossCriteria()
    probability: ProbabilityCriteria = ProbabilityCriteria()
    planning: PlanningCriteria = PlanningCriteria()
