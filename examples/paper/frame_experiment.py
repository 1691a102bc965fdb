"""Equations (4) and (5): difference of the instantaneous from the exact frame, by the size of the change.

The paper leaves the choice between the two open. Here both solve the same changes of the nine distances: random ones of
growing size, and those of a simulated warm-up.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.configuration import Configuration
from compd.machine_builder import build_model
from compd.model import MachineModel
from compd.model.kinematics import forward_kinematics, solve_frame
from compd.operation_settings import FRAME_DISTANCES
from compd.rotation import compose, rotation_matrix, to_outer
from compd.simulation import Strengths, World
from compd.units import UM_PER_MM
from gauge_log import GaugeLog
from instantaneous import frame_difference, frame_jacobians, instantaneous_frame

# Largest of the nine changes (mm): from a hundredth, an ordinary day, to more than any frame survives.
SIZES_MM = np.array([0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0])
DIRECTIONS = 500
# Times of the warm-up: every ten minutes for ten hours after switch-on, as in figure 21.
WARM_UP_HOURS, EVERY_S = 10.0, 600.0
# Step of the central differences of the tip by each distance, mm.
_STEP_MM = 1e-3
# Timing: one row per call, as in the daemon's cycle; many rows in one call, as in a comparison; and repetitions, of
# which the best counts.
ROWS_PER_CALL = 10_000
_CALLS, _TURNS = 1000, 15


class Difference(NamedTuple):
    """Instantaneous less exact frame, lengths of the differences; nan without an exact solution.

    displacement_mm : (...), of the origin of {B}.  rotation_rad : (...), of {B}.
    tip_mm : (...), of the tip with links as long as at machine zero; with the tool on the plate of the touched place.
    """

    displacement_mm: FloatArray
    rotation_rad: FloatArray
    tip_mm: FloatArray


@dataclass(frozen=True)
class Cost:
    """Microseconds per row, both ways taking turns in one run."""

    exact_us: float
    instantaneous_us: float

    @property
    def ratio(self) -> float:
        """Ratio of the costs, exact over instantaneous."""
        return self.exact_us / self.instantaneous_us


@dataclass(frozen=True)
class FrameResult:
    """Both frames compared.

    by_size : (sizes, directions) each, for changes whose largest is SIZES_MM.
    warm_up : (N,) each, at time_h (N,) after switch-on, for changes (N, 9) in mm.
    noise_um : standard deviation of the tip by the noise of the nine frame gauges, one reading each; noise_source says
    whose noise that is.
    single, many : cost with one row per call, and with ROWS_PER_CALL.
    """

    machine: str
    rate_hz: float
    by_size: Difference
    time_h: FloatArray
    warm_up_change_mm: FloatArray
    warm_up: Difference
    noise_um: float
    noise_source: str
    single: Cost
    many: Cost


def run_frame_experiment(configuration: Configuration, seed: int) -> FrameResult:
    """Compare the two ways on this machine; seed : of the directions and of the warm-up."""
    model = build_model(configuration.geometry, configuration.wiring)
    directions = np.random.default_rng([seed, 45]).normal(size=(DIRECTIONS, 9))
    directions /= np.abs(directions).max(axis=1, keepdims=True)
    time_h, warm_up_change_mm = _warm_up(configuration, seed)
    noise_mm, noise_source = frame_noise_mm(configuration)
    return FrameResult(
        configuration.machine,
        configuration.loop.rate_hz,
        difference(model, SIZES_MM[:, None, None] * directions),
        time_h,
        warm_up_change_mm,
        difference(model, warm_up_change_mm),
        float(np.linalg.norm(_tip_by_distances(model) * noise_mm)) * UM_PER_MM,
        noise_source,
        *_costs(model, SIZES_MM[0] * np.resize(directions, (ROWS_PER_CALL, 9))),
    )


def difference(model: MachineModel, changes_mm: FloatArray) -> Difference:
    """Difference of the instantaneous from the exact frame, for changes (..., 9) of the distances."""
    geometry = model.frame
    exact = solve_frame(geometry, model.zero.distances_mm + changes_mm)
    instantaneous = instantaneous_frame(geometry, changes_mm)
    base = compose(rotation_matrix(instantaneous.rotation_M_rad), geometry.zero_rotation_M_B)
    supports_mm = instantaneous.supports_M_mm[..., geometry.support_of_joint, :]
    base_joints_mm = to_outer(base[..., None, :, :], supports_mm, geometry.joint_offsets_B_mm)
    apart = frame_difference(exact, instantaneous)
    tip_mm = _tip_mm(model, base_joints_mm) - _tip_mm(model, exact.base_joints_M_mm)
    return Difference(apart.origin_mm, apart.rotation_rad, np.asarray(np.linalg.norm(tip_mm, axis=-1)))


def order(result: FrameResult) -> float:
    """The power of the change with which the tip's difference grows: the slope of a line through the logarithms."""
    return _line(result)[0]


def crossing_mm(result: FrameResult) -> float:
    """Change (mm) at which the tip's difference in the worst direction reaches the noise of the gauges."""
    slope, intercept = _line(result)
    return float(np.exp((np.log(result.noise_um / UM_PER_MM) - intercept) / slope))


def frame_noise_mm(configuration: Configuration) -> tuple[FloatArray, str]:
    """Standard deviation (9,) of one reading of each frame gauge (mm), and its source in words.

    What the configuration, or a driver by its data sheet, states where it is known of all nine, else that of the
    simulated comparators.
    """
    gauge_of = {wire.distance: wire.gauge for wire in configuration.wiring.frame}
    stated = [configuration.noise_of(gauge_of[distance]) for distance in FRAME_DISTANCES]
    stated_um = np.array([noise.um for noise in stated])
    if not np.isnan(stated_um).any():
        by_driver = any(noise.source != "configuration" for noise in stated)
        return stated_um / UM_PER_MM, f"declared in the configuration{' or by the driver' if by_driver else ''}"
    simulated_um = Strengths().comparator_noise_um
    return np.full(
        9, simulated_um / UM_PER_MM
    ), f"{simulated_um:g} um each, as simulated: the configuration does not declare all"


def _line(result: FrameResult) -> tuple[float, float]:
    """Slope and intercept of log(largest difference of the tip in mm) over log(change in mm), by least squares."""
    largest_mm = result.by_size.tip_mm.max(axis=1)
    solved = np.isfinite(largest_mm)
    slope, intercept = np.polyfit(np.log(SIZES_MM[solved]), np.log(largest_mm[solved]), 1)
    return float(slope), float(intercept)


def _tip_mm(model: MachineModel, base_joints_M_mm: FloatArray) -> FloatArray:
    """(..., 3) tip for base joints (..., n, 3) and the links of machine zero."""
    zero = model.zero
    pose = forward_kinematics(
        model.mechanism(base_joints_M_mm), zero.link_length_mm, zero.platform_origin_M_mm, zero.rotation_M_P
    )
    return model.arrangement.measured_tip_mm(model.arrangement.contact_at(pose))


def _tip_by_distances(model: MachineModel) -> FloatArray:
    """(3, 9) derivative of the tip by the nine distances at machine zero, by central differences."""
    steps_mm = _STEP_MM * np.concatenate([np.eye(9), -np.eye(9)])
    tips_mm = _tip_mm(model, solve_frame(model.frame, model.zero.distances_mm + steps_mm).base_joints_M_mm)
    return np.asarray((tips_mm[:9] - tips_mm[9:]).T / (2 * _STEP_MM))


def _warm_up(configuration: Configuration, seed: int) -> tuple[FloatArray, FloatArray]:
    """Hours since switch-on (N,), and changes of the nine distances (N, 9) as the simulated gauges read them, mm."""
    world = World(configuration.geometry, configuration.wiring, seed)
    log, time_h = GaugeLog(), []
    for _ in range(int(WARM_UP_HOURS * 3600.0 / EVERY_S) + 1):
        log.read(world)
        time_h.append(world.time_s / 3600.0)
        world.start_tour()
        world.advance(EVERY_S)
    return np.array(time_h), np.array(log.frame_mm)


def _costs(model: MachineModel, changes_mm: FloatArray) -> tuple[Cost, Cost]:
    """Cost with one row per call and with many; the Jacobians are constant and computed before."""
    geometry, jacobians = model.frame, frame_jacobians(model.frame)
    distances_mm = model.zero.distances_mm + changes_mm
    first_mm, first_change_mm = distances_mm[0], changes_mm[0]
    rows = len(changes_mm)
    us = _best_us(
        (lambda: solve_frame(geometry, first_mm), _CALLS, 1),
        (lambda: instantaneous_frame(geometry, first_change_mm, jacobians), _CALLS, 1),
        (lambda: solve_frame(geometry, distances_mm), 1, rows),
        (lambda: instantaneous_frame(geometry, changes_mm, jacobians), 1, rows),
    )
    return Cost(us[0], us[1]), Cost(us[2], us[3])


def _best_us(*ways: tuple[Callable[[], object], int, int]) -> list[float]:
    """Microseconds per row of each (action, calls, rows per call), taking turns; the best turn of each."""
    best = [np.inf] * len(ways)
    for _ in range(_TURNS):
        for i, (action, calls, rows) in enumerate(ways):
            start = time.perf_counter()
            for _ in range(calls):
                action()
            best[i] = min(best[i], (time.perf_counter() - start) / (calls * rows) * 1e6)
    return best
