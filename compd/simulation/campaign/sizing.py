"""Sizing of causes: the strength at which the tip's error has a wanted size, from short campaigns without noise."""

from __future__ import annotations

from collections.abc import Sequence

from compd.configuration import Geometry
from compd.operation_settings import Wiring
from compd.simulation.campaign.campaign import Campaign
from compd.simulation.campaign.campaign_plan import CampaignPlan, draw_campaign_plan
from compd.simulation.causes.catalogue import CAUSES, build_cause, possible_causes, shuffle_causes
from compd.simulation.causes.hidden_cause import HiddenCause, SizedCause
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.instruments import TRACKER_SIGMA_UM
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.strengths import FULLY_MEASURED_WITHOUT_NOISE, seen_by
from compd.simulation.truth.weather import STANDARD_AIR, AirAtZero

# Number of visits and passes of which one is run to measure the size of the error.
KEEP_ONE_IN = 6
FIRST_SHARE = 0.2
GOOD_ENOUGH = 0.05
MAX_TRIES = 4
# Number and size of the weak disturbances in every campaign; size as a share of the reference's noise.
WEAK_FLOORS = 0.2
WEAK_CAUSES = 2


class CauseSizer:
    """Sizes causes on the machine of `seed`."""

    def __init__(
        self,
        geometry: Geometry,
        wiring: Wiring,
        seed: int,
        floor_um: float = TRACKER_SIGMA_UM,
        air_at_zero: AirAtZero = STANDARD_AIR,
        plan: CampaignPlan | None = None,
    ) -> None:
        """plan : in which an error has its size; left out: the machine's usual campaign."""
        self._geometry, self._wiring, self._seed, self._floor_um = geometry, wiring, seed, floor_um
        self.mechanism = Mechanism(geometry)
        self.plan = plan or draw_campaign_plan(self.mechanism, seed, air_at_zero=air_at_zero)
        self._short = self.plan.thinned(KEEP_ONE_IN)

    def error_in_floors(self, cause: Cause) -> float:
        """rms of the tip's error that the gauges do not measure, over the noise floor.

        The cause's memory is changed: build a new one for further use.
        """
        # a thinned plan has too few rows on the move
        days = self.plan if cause.only_in_motion else self._short
        strengths = seen_by(FULLY_MEASURED_WITHOUT_NOISE, len(self._wiring.joint))
        campaign = Campaign(self._geometry, self._wiring, days, self._seed, strengths, [cause])
        return campaign.run().error_um() / self._floor_um

    def size(self, hidden: HiddenCause) -> SizedCause:
        """The cause with the strength asked for, or with that for the size asked for, within its plausible range.

        Assumes that the error is proportional to the strength, and corrects it in at most MAX_TRIES tries.
        """
        if hidden.strength is not None:
            floors = self.error_in_floors(self._build(hidden.id, hidden.strength))
            return SizedCause(self._build(hidden.id, hidden.strength), floors)
        kind = CAUSES[hidden.id]
        strength, floors = FIRST_SHARE * kind.max_strength, 0.0
        for _ in range(MAX_TRIES):
            floors = self.error_in_floors(self._build(hidden.id, strength))
            if floors == 0 or abs(floors / hidden.floors - 1) < GOOD_ENOUGH:
                break
            wanted = min(max(strength * hidden.floors / floors, kind.min_strength), kind.max_strength)
            if wanted == strength:
                break
            strength = wanted
        return SizedCause(self._build(hidden.id, strength), floors)

    def weak_disturbances(self, besides: Sequence[str]) -> list[Cause]:
        """WEAK_CAUSES causes other than `besides`, each too weak to be found by a diagnosis."""
        others = [name for name in possible_causes(self.mechanism, self._wiring) if name not in besides]
        causes = []
        for name in shuffle_causes(others, self._seed, "weak")[:WEAK_CAUSES]:
            largest = CAUSES[name].max_strength
            strength = FIRST_SHARE * largest
            floors = self.error_in_floors(self._build(name, strength))
            # a cause with a negligible effect here keeps its largest plausible strength
            causes.append(self._build(name, min(strength * WEAK_FLOORS / floors, largest) if floors > 0 else strength))
        return causes

    def _build(self, name: str, strength: float) -> Cause:
        return build_cause(name, strength, self.mechanism, self._seed)
