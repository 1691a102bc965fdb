"""A whole recording from the simulated machine: its columns, what its sidecar says, and what was hidden."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration
from compd.recording.sidecar import sidecar_contents
from compd.simulation.campaign.campaign import Campaign
from compd.simulation.campaign.campaign_plan import CampaignPlan, plan
from compd.simulation.campaign.planned_campaign import PlannedCampaign
from compd.simulation.campaign.sizing import Sized, Sizing
from compd.simulation.causes.catalogue import HiddenCause
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.instruments import SIGMA_UM, Kind, ball_plate_mm
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.strengths import SEEN

OUTLIER_SHARE = 0.01
QUANTITY = {"tracker": "tool_position", "interferometer": "link_length", "ball_plate": "ball_plate"}


@dataclass(frozen=True)
class Recorded:
    """columns : by name with unit, (N,). sidecar : for NAME.yaml. balls_M : (17, 3) of the ball plate, or None.

    hidden, weak : the causes at work, asked for and not; a scorer's business.
    """

    columns: Mapping[str, Sequence[float]]
    sidecar: Mapping[str, Any]
    balls_M: FloatArray | None
    hidden: tuple[Sized, ...]
    weak: tuple[Cause, ...]

    @property
    def reference_columns(self) -> list[str]:
        """What the instrument showed; nan where only the gauges were read."""
        return [name for name in self.columns if name.startswith("reference_")]


def record(
    configuration: Configuration,
    seed: int,
    hidden: Sequence[HiddenCause],
    reference: Kind = "tracker",
    plate_file: str = "",
    other_days: int = 0,
    given: Sequence[PlannedRow] = (),
) -> Recorded:
    """One campaign. `seed`: machine and parts; `other_days`: another campaign on the same machine.

    `plate_file`: the ball plate's file, beside the recording. `given`: measure these rows, on the same machine, and
    nothing else; not with a ball plate, whose balls are where they are.
    """
    geometry, wiring = configuration.geometry, configuration.wiring
    sizing = Sizing(geometry, wiring, seed)
    sized = tuple(sizing.cause(one) for one in hidden)
    weak = sizing.weak([one.id for one in hidden], np.random.default_rng([seed, 3]))
    causes = [*(one.cause for one in sized), *weak]
    sigma_um = SIGMA_UM[reference]
    campaign: Campaign | PlannedCampaign
    balls_M = None
    if given:
        campaign = PlannedCampaign(
            geometry,
            wiring,
            given,
            seed,
            other_days,
            SEEN,
            causes,
            reference=reference,
            sigma_um=sigma_um,
            outlier_share=OUTLIER_SHARE,
        )
    else:
        balls_M, days = _days(sizing.mechanism, reference, seed, other_days)
        campaign = Campaign(
            geometry,
            wiring,
            days,
            seed,
            SEEN,
            causes,
            reference=reference,
            sigma_um=sigma_um,
            outlier_share=OUTLIER_SHARE,
            balls_M=balls_M,
        )
    says: dict[str, Any] = {"quantity": QUANTITY[reference], "sigma_um": sigma_um}
    if reference == "tracker":
        says["frame"] = "machine"
    if balls_M is not None:
        says["balls"] = plate_file
    return Recorded(campaign.run().columns, sidecar_contents(configuration.machine, says), balls_M, sized, tuple(weak))


def _days(mechanism: Mechanism, reference: Kind, seed: int, number: int) -> tuple[FloatArray | None, CampaignPlan]:
    """The plan; with a ball plate its points are the balls, and there is no pass on the move."""
    if reference != "ball_plate":
        return None, plan(mechanism, seed, number)
    balls_M = ball_plate_mm(mechanism.tip0_M)
    turn_rad = np.zeros(3)
    postures = [mechanism.posture_at(ball_M, turn_rad) for ball_M in balls_M]
    points_mm = np.array([mechanism.lengths(posture) - mechanism.lengths0_mm for posture in postures])
    return balls_M, plan(mechanism, seed, number, points_mm=points_mm, passes=0)
