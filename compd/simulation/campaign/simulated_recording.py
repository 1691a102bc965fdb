"""A complete recording of a simulated campaign: columns, sidecar, and the causes that were hidden."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration, shipped_configuration, shipped_names
from compd.recording import sidecar_contents
from compd.simulation.campaign.campaign import Campaign
from compd.simulation.campaign.campaign_plan import CampaignPlan, draw_campaign_plan
from compd.simulation.campaign.planned_campaign import PlannedCampaign
from compd.simulation.campaign.sizing import CauseSizer
from compd.simulation.causes.hidden_cause import HiddenCause, SizedCause
from compd.simulation.truth.cause import Cause
from compd.simulation.truth.fixed_places import (
    PROBE_RADIUS_MM,
    TOUCHED_RADIUS_MM,
    FixedPlaces,
    ballbar_places,
    pin_places,
    touched_ball_places,
)
from compd.simulation.truth.instruments import INSTRUMENTS, TRACKER_SIGMA_UM, Kind, ball_plate_mm
from compd.simulation.truth.mechanism import Mechanism
from compd.simulation.truth.planned_row import PlannedRow
from compd.simulation.truth.strengths import FULLY_MEASURED, seen_by
from compd.simulation.truth.weather import STANDARD_AIR, AirAtZero

OUTLIER_SHARE = 0.01
QUANTITY: Mapping[Kind, str] = {
    "tracker": "tool_position",
    "interferometer": "link_length",
    "ball_plate": "ball_plate",
    "ballbar": "distance",
    "pin": "fixed_point",
    "ball": "distance",
    "pose": "tool_pose",
}
FIXED: Mapping[Kind, Callable[[Mechanism, np.random.Generator], FixedPlaces]] = {
    "ballbar": ballbar_places,
    "pin": pin_places,
    "ball": touched_ball_places,
}


@dataclass(frozen=True)
class SimulatedRecording:
    """columns : by name with unit, (N,). sidecar : for NAME.yaml. balls_M : (17, 3) of the ball plate, or None.

    hidden : the causes asked for. weak : disturbances in addition. Both for the answer file only.
    """

    columns: Mapping[str, Sequence[float]]
    sidecar: Mapping[str, Any]
    balls_M: FloatArray | None
    hidden: tuple[SizedCause, ...]
    weak: tuple[Cause, ...]

    @property
    def reference_columns(self) -> list[str]:
        """Names of the reference's coordinates; their values are nan where only the gauges were read."""
        return [name for name in self.columns if name.startswith("reference_")]


def simulate_recording(
    configuration: Configuration,
    seed: int,
    hidden: Sequence[HiddenCause],
    reference: Kind = "tracker",
    plate_file: str = "",
    other_days: int = 0,
    planned_rows: Sequence[PlannedRow] = (),
    air_at_zero: AirAtZero = STANDARD_AIR,
) -> SimulatedRecording:
    """Run one campaign.

    seed : of machine, parts and noise. other_days : number of another campaign on the same machine.
    plate_file : name of the ball plate's file, for the sidecar. planned_rows : measure these rows instead of a drawn
    plan; not with a ball plate, whose balls have fixed places. air_at_zero : when machine zero is taken.
    """
    geometry, wiring = configuration.geometry, configuration.wiring
    sizer = CauseSizer(geometry, wiring, seed, max(INSTRUMENTS[reference].sigma_um, TRACKER_SIGMA_UM), air_at_zero)
    sized = tuple(sizer.size(cause) for cause in hidden)
    weak = sizer.weak_disturbances([cause.id for cause in hidden])
    causes = [*(cause.cause for cause in sized), *weak]
    instrument = replace(INSTRUMENTS[reference], outlier_share=OUTLIER_SHARE)
    strengths = seen_by(FULLY_MEASURED, len(wiring.joint))
    campaign: Campaign | PlannedCampaign
    balls_M = None
    if planned_rows:
        campaign = PlannedCampaign(
            geometry, wiring, planned_rows, seed, other_days, strengths, causes, instrument, air_at_zero
        )
    else:
        balls_M, places, days = _days(sizer.mechanism, reference, seed, other_days, air_at_zero)
        campaign = Campaign(
            geometry, wiring, days, seed, strengths, causes, reference=instrument, balls_M=balls_M, places=places
        )
    reference_block: dict[str, Any] = {"quantity": QUANTITY[reference], "sigma_um": instrument.sigma_um}
    if reference in ("tracker", "pose"):
        reference_block["frame"] = "machine"
    if reference == "pose":
        reference_block["sigma_urad"] = instrument.sigma_urad
    if reference == "ball":
        reference_block |= {"radius_mm": TOUCHED_RADIUS_MM + PROBE_RADIUS_MM, "absolute": True}
    if balls_M is not None:
        reference_block["balls"] = plate_file
    logged = campaign.run()
    shipped = {shipped_configuration(f"{name}.yaml").resolve() for name in shipped_names()}
    sidecar = sidecar_contents(
        configuration.machine,
        reference_block,
        quantities_at_zero=logged.quantities_at_zero,
        # a shipped one is found by its name
        machine_file=None if configuration.path.resolve() in shipped else configuration.path,
    )
    return SimulatedRecording(logged.columns, sidecar, balls_M, sized, tuple(weak))


def _days(
    mechanism: Mechanism, reference: Kind, seed: int, number: int, air: AirAtZero
) -> tuple[FloatArray | None, FixedPlaces | None, CampaignPlan]:
    """Balls of a plate (17, 3) or None, fixed balls or pins or None, and the plan.

    What is fixed is where the plan's points are, and without passes: nothing is measured on the way.
    """
    if reference in FIXED:
        places = FIXED[reference](mechanism, np.random.default_rng([seed, 5, number]))
        return (
            None,
            places,
            draw_campaign_plan(mechanism, seed, number, points_mm=places.scale_mm, passes=0, air_at_zero=air),
        )
    if reference != "ball_plate":
        return None, None, draw_campaign_plan(mechanism, seed, number, air_at_zero=air)
    balls_M = ball_plate_mm(mechanism.tip0_M)
    turn_rad = np.zeros(3)
    postures = [mechanism.posture_at(ball_M, turn_rad) for ball_M in balls_M]
    points_mm = np.array([mechanism.scales_at(posture) for posture in postures])
    return balls_M, None, draw_campaign_plan(mechanism, seed, number, points_mm=points_mm, passes=0, air_at_zero=air)
