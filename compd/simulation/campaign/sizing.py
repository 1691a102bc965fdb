"""How strong a cause must be for the tip's error to have a wanted size: found by running a short campaign."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from compd.configuration.geometry import Geometry
from compd.configuration.operation import Wiring
from compd.simulation.campaign.campaign import Campaign
from compd.simulation.campaign.campaign_plan import CampaignPlan, plan
from compd.simulation.causes.catalogue import CAUSES, HiddenCause, build, possible
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.instruments import TRACKER_SIGMA_UM
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import SEEN_WITHOUT_NOISE

# Every so many visits and passes of a campaign tell its size.
KEEP_ONE_IN = 6
FIRST_SHARE = 0.2
GOOD_ENOUGH = 0.05
MOST_TRIES = 4
# Two causes that nobody asked for, each too weak to be found: this share of the reference's noise.
WEAK_FLOORS = 0.2
WEAK_CAUSES = 2


class Sized(NamedTuple):
    """A cause, and how large it makes the tip's error: rms per coordinate over the reference's sigma."""

    cause: Cause
    floors: float


class Sizing:
    """Short campaigns on one machine; `seed`: of machine and plan."""

    def __init__(self, geometry: Geometry, wiring: Wiring, seed: int, floor_um: float = TRACKER_SIGMA_UM) -> None:
        self._geometry, self._wiring, self._seed, self._floor_um = geometry, wiring, seed, floor_um
        self.mechanism = Mechanism(geometry)
        self.plan: CampaignPlan = plan(self.mechanism, seed)
        self._short = self.plan.thinned(KEEP_ONE_IN)

    def floors(self, cause: Cause) -> float:
        """rms of the tip's error that the gauges do not see, over the floor; the cause's memory is used up."""
        # of the few rows on the move a share would tell its size badly
        days = self.plan if cause.in_motion else self._short
        campaign = Campaign(self._geometry, self._wiring, days, self._seed, SEEN_WITHOUT_NOISE, [cause])
        return campaign.run().error_um() / self._floor_um

    def cause(self, hidden: HiddenCause) -> Sized:
        """As strong as asked for, or as strong as it takes, within what is plausible."""
        if hidden.strength is not None:
            return Sized(self._build(hidden.id, hidden.strength), self.floors(self._build(hidden.id, hidden.strength)))
        kind = CAUSES[hidden.id]
        strength, floors = FIRST_SHARE * kind.most, 0.0
        for _ in range(MOST_TRIES):
            floors = self.floors(self._build(hidden.id, strength))
            if floors == 0 or abs(floors / hidden.floors - 1) < GOOD_ENOUGH:
                break
            wanted = min(max(strength * hidden.floors / floors, kind.least), kind.most)
            if wanted == strength:
                break
            strength = wanted
        return Sized(self._build(hidden.id, strength), floors)

    def weak(self, besides: Sequence[str], rng: np.random.Generator) -> list[Cause]:
        """Two causes of those that are not `besides`, each too weak to be found: taken down in proportion."""
        others = [name for name in possible(self.mechanism) if name not in besides]
        names = rng.choice(others, WEAK_CAUSES, replace=False).tolist()
        found = []
        for name in names:
            strength = FIRST_SHARE * CAUSES[name].most
            floors = self.floors(self._build(name, strength))
            found.append(self._build(name, strength * WEAK_FLOORS / floors if floors > 0 else strength))
        return found

    def _build(self, name: str, strength: float) -> Cause:
        return build(name, strength, self.mechanism, self._seed)
