"""Thresholds by which drifts and machines that differ are named, each with its meaning, its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FleetCriteria:
    """Numbers on which the sentences of a fleet's page rest.

    `thresholds` reads unit, meaning and reason of each.
    """

    fewest_campaigns: int = 3
    """recordings of one machine | fewer values of a parameter show no drift | a line goes through any two points:
    nothing is left that could contradict it"""
    drift_p_value: float = 0.01
    """probability | a drift is named where a parameter that stays the same shows so steep a line more rarely, all lines
    of the fleet counted together (Bonferroni) | a fleet without any drift names one in a hundred pages"""
    scatter_p_value: float = 0.05
    """probability | where a machine's values scatter about their line more than chance makes of the standard errors,
    which grow with the scatter of all machines, its own scatter counts | the customary level; the ratio is Birge's,
    Phys. Rev. 40 (1932) 207"""
    steady_share: float = 0.5
    """share of a machine's recordings | an effect found on more of them is one that the machine has; errors are
    compared among machines that have the same ones | most recordings outvote a diagnosis that errs now and then, as in
    one campaign of one weather"""
    fewest_machines: int = 6
    """machines | among fewer none is said to differ from the others | of five machines that are alike one in sixteen
    sets has a robust score above 7, of six one in 36"""
    outlying_score: float = 7.0
    """standard deviations, robust | a machine whose value is farther from the median of all machines differs | 20,000
    simulated sets of normal values: among 6 machines that are alike 3 % of the quantities have one beyond it, among 20
    0.2 %; beyond the customary 3.5 (Iglewicz and Hoaglin, 1993) 15 % and 10 %"""
