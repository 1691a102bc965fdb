"""The probability that the named set is right: the odds that the held-out scores of the sets that were seen give."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from compd.diagnosis.probability_criteria import ProbabilityCriteria
from compd.text import nan_to_null

NOT_TESTED = "no effect could be tested, so that none was compared with another"


@dataclass(frozen=True)
class NamedProbability:
    """How probable it is that all that has to be named is named, and nothing else."""

    #: expected number of the sets that were seen, name something else, and would score better on rows like these; 0
    #: where descriptions refuse every effect, nan where none was compared
    better_sets: float = math.nan
    #: how many sets the verdict itself tells as possible: with each named effect or a rival in its place
    sets_told: int = 1
    above_noise: bool = False  #: whether a part of the error above the noise has neither name nor description
    unknown: str = ""  #: why no probability can be stated; ``""`` where one is
    #: the numbers by which odds follow from these
    criteria: ProbabilityCriteria = field(default=ProbabilityCriteria(), repr=False)

    @property
    def value(self) -> float:
        """The probability, 0 to 1; nan where none can be stated."""
        criteria = self.criteria
        odds = criteria.certain - criteria.per_better * math.log1p(self.better_sets / criteria.unseen)
        odds -= criteria.per_told * math.log(self.sets_told) + criteria.above_noise * self.above_noise
        return 1.0 / (1.0 + math.exp(-odds))

    @property
    def confirms(self) -> bool:
        """Whether the set is probable enough to be called identified."""
        return not self.value < self.criteria.identified_from

    def as_json(self) -> dict[str, Any]:
        """Keys of the verdict."""
        evidence = {"better_sets": self.better_sets, "sets_told": self.sets_told, "above_noise": self.above_noise}
        return {
            "probability": nan_to_null(self.value),
            "probability_from": {**evidence, **({"unknown": self.unknown} if self.unknown else {})},
        }
