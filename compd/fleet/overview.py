"""Results of a fleet in words and tables, for the page and for the terminal."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import median

from compd.display_unit import format_error
from compd.fleet.criteria import FleetCriteria
from compd.fleet.drift import Drift, drifts, named_drifts
from compd.fleet.outlying import ERROR, ERROR_LEFT, OutlyingMachine, outlying_machines
from compd.fleet.recording_result import AT_FLOOR, RecordingResult
from compd.fleet.steady_effects import LoneEffect, lone_effects, steady_effects
from compd.report import PageTable
from compd.text import estimate_text, join_words, number_text

# Verdicts of recordings that the model explains: of `diagnose`, and of `compare`.
_NOTHING_MISSING = ("adequate", AT_FLOOR)
_UNEXPLAINED = ("unexplained", "partial")
# Beside the effects: an error without a known cause.
NOT_EXPLAINED = "not explained"
_NO_MACHINE = "(no machine named)"
_DATE = "%Y-%m-%d"


@dataclass(frozen=True)
class Overview:
    """The results of a fleet with joint conclusions."""

    results: Sequence[RecordingResult]
    criteria: FleetCriteria = FleetCriteria()

    @cached_property
    def examined(self) -> list[RecordingResult]:
        """Results without a problem."""
        return [result for result in self.results if not result.problem]

    @cached_property
    def failed(self) -> list[RecordingResult]:
        """Recordings that could not be examined."""
        return [result for result in self.results if result.problem and not result.not_done]

    @cached_property
    def not_done(self) -> int:
        """Number of recordings left undone for lack of time."""
        return sum(result.not_done for result in self.results)

    @cached_property
    def machines(self) -> list[str]:
        """Machines with a recording that was examined, by name."""
        return sorted({result.machine for result in self.examined})

    @cached_property
    def effects(self) -> list[str]:
        """Effects that a machine has on most of its recordings: those of the most machines first."""
        having = Counter(effect for effects in self.steady.values() for effect in effects)
        return sorted(having, key=lambda effect: (-having[effect], effect))

    @cached_property
    def drifts(self) -> tuple[Drift, ...]:
        """Every parameter of every machine over its campaigns."""
        return drifts(self.results, self.criteria)

    @cached_property
    def outlying(self) -> tuple[OutlyingMachine, ...]:
        """Machines that differ from the others."""
        return outlying_machines(self.examined, self.drifts, self.criteria)

    @cached_property
    def lone(self) -> tuple[LoneEffect, ...]:
        """Effects that one machine alone has."""
        return lone_effects(self.examined, self.criteria)

    @cached_property
    def steady(self) -> dict[str, frozenset[str]]:
        """Machine -> the effects that it has on most of its recordings."""
        return steady_effects(self.examined, self.criteria)

    @cached_property
    def unexplained(self) -> Counter[str]:
        """Machine -> recordings with an error of which no effect is the whole cause."""
        return Counter(result.machine for result in self.examined if result.verdict in _UNEXPLAINED)

    @property
    def unexplained_machines(self) -> list[str]:
        """Machines with such an error on most of their recordings."""
        share = self.criteria.steady_share
        return [machine for machine in self.machines if self.unexplained[machine] > share * len(self.of(machine))]

    @cached_property
    def quiet(self) -> list[str]:
        """Inconspicuous machines: no recording has an effect or an unexplained error."""
        return [
            machine
            for machine in self.machines
            if not any(outlying.machine == machine for outlying in self.outlying)
            and all(result.verdict in _NOTHING_MISSING and not result.effects for result in self._by_machine[machine])
        ]

    @cached_property
    def _by_machine(self) -> dict[str, list[RecordingResult]]:
        by_machine: dict[str, list[RecordingResult]] = {}
        for result in self.examined:
            by_machine.setdefault(result.machine, []).append(result)
        return by_machine

    def of(self, machine: str) -> list[RecordingResult]:
        """The recordings of a machine that were examined."""
        return self._by_machine[machine]

    def counts(self, machine: str) -> Counter[str]:
        """Effect -> recordings of the machine on which it was found."""
        return Counter(effect for result in self.of(machine) for effect in result.effects)

    @property
    def headline(self) -> str:
        """Counts of examined recordings and of findings, in a sentence or two."""
        recordings = _counted(len(self.examined), "recording")
        text = f"{recordings} of {_counted(len(self.machines), 'machine')} examined"
        text += f"; {_counted(len(self.failed), 'other')} could not be" if self.failed else ""
        text += f"; {_counted(self.not_done, 'is', 'are')} not done yet." if self.not_done else "."
        named = named_drifts(self.drifts)
        having = sum(map(bool, self.steady.values()))
        differing = {outlying.machine for outlying in self.outlying} | {lone.machine for lone in self.lone}
        findings = [_counted(having, "machine has an effect", "machines have effects")] if having else []
        unexplained = len(self.unexplained_machines)
        if unexplained:
            findings.append(_counted(unexplained, "has an error not explained", "have an error not explained"))
        findings += [_counted(len(named), "parameter drifts", "parameters drift")] if named else []
        findings += [_counted(len(differing), "machine differs", "machines differ")] if differing else []
        return f"{text} {join_words(findings)}." if findings else text

    def machine_table(self, without: Sequence[str] = ()) -> PageTable:
        """A row for each machine: number of recordings, verdicts, error and noise, effects.

        without : machines that are left out.
        """
        head = ("machine", "recordings", "verdicts", "error", "left", "noise", "effects")
        rows = []
        for machine in self.machines:
            if machine in without:
                continue
            results = self.of(machine)
            verdicts = Counter(result.verdict for result in results)
            effects = self.counts(machine)
            rows.append(
                [
                    machine,
                    str(len(results)),
                    ", ".join(f"{count} {verdict.replace('_', ' ')}" for verdict, count in verdicts.most_common()),
                    _median_text(results, "rms_before_um"),
                    _median_text(results, "rms_after_um"),
                    _median_text(results, "noise_floor_um"),
                    ", ".join(f"{effect} ({count})" for effect, count in effects.most_common()) or "none",
                ]
            )
        return PageTable(head, rows)

    def drift_sentences(self) -> list[str]:
        """Drifts, the surest first."""
        return [drift_sentence(drift) for drift in named_drifts(self.drifts)]

    def outlying_sentences(self) -> list[str]:
        """Differing machines: the farthest first, then those with an effect that no other has."""
        return [*map(outlying_sentence, self.outlying), *map(lone_sentence, self.lone)]

    def unexplained_sentences(self) -> list[str]:
        """Machines with an unexplained error, and its size."""
        sentences = []
        for machine in self.unexplained_machines:
            results = self.of(machine)
            unit = results[0].error_unit
            error = median(result.rms_before_um for result in results)
            left = median(result.rms_after_um if result.estimates else result.rms_before_um for result in results)
            text = f"an error of {format_error(error, unit)}"
            if left < error:
                text = f"{format_error(left, unit)} of {text}"
            counted = f"on {self.unexplained[machine]} of its {_counted(len(results), 'recording')}"
            sentences.append(f"{machine}: {text} has a cause that is not known ({counted})")
        return sentences

    def sentences(self) -> list[str]:
        """Findings: drifts, differing machines, and unexplained errors."""
        return [*self.drift_sentences(), *self.outlying_sentences(), *self.unexplained_sentences()]

    def problem_table(self) -> PageTable:
        """Recordings that could not be examined, each with the reason."""
        rows = [(short_name(result), result.machine or _NO_MACHINE, result.problem) for result in self.failed]
        return PageTable(("recording", "machine", "problem"), rows)


def short_name(result: RecordingResult) -> str:
    """The recording's file with its folder."""
    path = Path(result.recording)
    return f"{path.parent.name}/{path.name}"


def drift_sentence(drift: Drift) -> str:
    """ "tripod-03: link_expansion.a changes by 0.21 +- 0.03 ppm/K from 2026-01-05 to 2026-06-01 (6 campaigns)"."""
    if drift.started_at:
        over = f"from {drift.started_at[0]:{_DATE}} to {drift.started_at[-1]:{_DATE}}"
    else:
        over = f"from campaign {drift.time[0]:g} to {drift.time[-1]:g}"
    change = estimate_text(drift.change, drift.change_std, drift.unit)
    return f"{drift.machine}: {drift.name} changes by {change} {over} ({len(drift.time)} values)"


def outlying_sentence(outlying: OutlyingMachine) -> str:
    """ "tripod-03: link_expansion.a is 4.1 +- 0.1 ppm/K, the median of 12 machines is 1.1 ppm/K"."""
    if outlying.quantity in (ERROR, ERROR_LEFT):
        value, middle = (format_error(error, outlying.unit) for error in (outlying.value, outlying.median))
    else:
        value = estimate_text(outlying.value, outlying.standard_error, outlying.unit)
        middle = number_text(outlying.median, outlying.unit, digits=3)
    return (
        f"{outlying.machine}: {outlying.quantity} is {value}, the median of {outlying.machines} machines is {middle} "
        f"({outlying.score:.0f} robust standard deviations)"
    )


def lone_sentence(lone: LoneEffect) -> str:
    """ "tripod-03: alone of 12 machines has backlash (on 4 of its 4 recordings)"."""
    return (
        f"{lone.machine}: alone of {lone.machines} machines has {lone.effect} (on {lone.found_on} of its "
        f"{_counted(lone.recordings, 'recording')})"
    )


def _counted(count: int, one: str, several: str = "") -> str:
    return f"{count} {one if count == 1 else several or one + 's'}"


def _median_text(results: Sequence[RecordingResult], name: str) -> str:
    """The median over the recordings, with its unit; "-" where none has the number."""
    values = [value for result in results if not math.isnan(value := getattr(result, name))]
    return format_error(median(values), results[0].error_unit) if values else "-"
