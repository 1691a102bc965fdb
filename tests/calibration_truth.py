"""`python -m tests.calibration_truth`: calibrations of simulated machines whose every number is off by its tolerance.

The machines are those of `compd.machine_kinds`. Truth is `compd.simulation`, which shares no code with the model: the
numbers of a machine's YAML are changed, and readings and poses computed from them. Told are, pooled over machines:
which share of 95 % intervals holds the truth; the error at poses of the whole workspace, over that of a fit with the
truth's own blocks; and the same of `scipy.optimize.least_squares` over all numbers, without and with the tolerance as
prior.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from scipy.optimize import least_squares

import compd
from compd.arrays import FloatArray, rms
from compd.calibration import Parameters, calibration_parameters, without
from compd.calibration.machine_fit import fit_machine, registered_mm
from compd.calibration.poses import MeasuredPoses
from compd.comparison import AlignedRecording
from compd.machine_kinds import KINDS
from tests.support.built_machines import NOISE_MM, NOISE_RAD, built, drawing, record, truth

WITHIN_STD = 1.96
# Of a difference of two equal numbers that were computed.
ROUNDING = 1e-9


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--machines", type=int, default=3)
    parser.add_argument("--first", type=int, default=0, help="seed of the first machine")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--scipy", action="store_true")
    parser.add_argument("--poses", type=int, default=0)
    parser.add_argument("--position", action="store_true")
    parser.add_argument("--probability", type=float, default=1.0, help="that the numbers of a kind are off at all")
    arguments = parser.parse_args()
    console = Console(stderr=True)
    inside_all: list[bool] = []
    for kind in arguments.kinds.split(","):
        inside: list[bool] = []
        ratios, drawn_ratio, plain, with_prior, lengths = [], [], [], [], []
        for seed in track(range(arguments.first, arguments.first + arguments.machines), kind, console=console):
            with tempfile.TemporaryDirectory() as place:
                directory = Path(place)
                rng = np.random.default_rng([seed, list(KINDS).index(kind)])
                path = drawing(kind, directory)
                world = built(path, rng, probability=arguments.probability)
                count = arguments.poses or int(rng.integers(30, 101))
                pose = not arguments.position
                learned = compd.open_recording(record(directory / "a.csv", world, rng, count, pose=pose))
                other = compd.open_recording(record(directory / "b.csv", world, rng, 100, noise=0.0, pose=pose))
                result = compd.calibrate(learned, other)
                parameters = calibration_parameters(learned.model, learned.rows, (), ["tool_offset"] if pose else [])
                own = truth(world, parameters)
                for number, off in zip(result.numbers, own, strict=True):
                    if number.claimed:
                        inside.append(abs(number.change - off) <= WITHIN_STD * number.std)
                mine = result.sealed[0]
                structure = _structure_um(learned, other, parameters, own)
                ratios.append(mine.after_rms_um / structure)
                drawn_ratio.append(mine.before_rms_um)
                lengths.append(mine.after_rms_um)
                if arguments.scipy:
                    plain.append(_scipy_um(learned, other, parameters, 0.0) / structure)
                    with_prior.append(_scipy_um(learned, other, parameters, 1.0) / structure)
        inside_all += inside
        print(
            f"{kind:13} 95 % hold {100 * np.mean(inside):5.1f} % of {len(inside)} claimed, "
            "drawn "
            f"{np.median(drawn_ratio):6.1f} um, calibrated {np.median(lengths):5.2f} um, over the truth's structure "
            f"{np.median(ratios):.2f} (largest {np.max(ratios):.2f}, {np.sum(np.array(ratios) > 1.2)} above 1.2)"
            + (
                f"; scipy {np.median(plain):.2f} (largest {np.max(plain):.2f}), "
                f"with prior {np.median(with_prior):.2f} (largest {np.max(with_prior):.2f})"
                if plain
                else ""
            ),
            flush=True,
        )
    print(f"pooled: {100 * np.mean(inside_all):.1f} % of {len(inside_all)}")


def _structure_um(learned: AlignedRecording, other: AlignedRecording, parameters: Parameters, own: FloatArray) -> float:
    """A fit of the blocks that are off in truth, by own (P,), with their tolerances as prior."""
    free = np.isin(parameters.block_of, parameters.block_of[np.abs(own) > ROUNDING])
    fit = fit_machine([MeasuredPoses.of(learned, parameters)], parameters, free)
    return _error_um(other, parameters, fit.theta)


def _error_um(other: AlignedRecording, parameters: Parameters, theta: FloatArray) -> float:
    count = len(theta)
    effects = parameters.split(theta, np.zeros((count, count)), range(len(parameters.blocks)))
    now = MeasuredPoses.of(other, parameters).now(effects)
    left = registered_mm(now, now.use)[1][now.use][:, now.aligned.lengths]
    return 1e3 * rms(left)


def _scipy_um(learned: AlignedRecording, other: AlignedRecording, parameters: Parameters, prior: float) -> float:
    """`scipy.optimize.least_squares` over all numbers of the truth, in tolerances."""
    poses = MeasuredPoses.of(learned, parameters)
    free = ~np.array([name.startswith(("scale_gain_change", "tool_offset")) for name in parameters.names])
    count = len(free)
    sigma = np.full(learned.measured_mm.shape[1], NOISE_MM)
    if learned.with_attitude:
        sigma[3:] = 1e3 * NOISE_RAD

    def both(x: FloatArray) -> FloatArray:
        """Residual beside its derivatives, the registration projected out."""
        theta = np.zeros(count)
        theta[free] = x * parameters.prior_std[free]
        now = poses.now(parameters.split(theta, np.zeros((count, count)), range(len(parameters.blocks))))
        use = poses.use
        R = (now.registration_mm[use] / sigma[:, None]).reshape(-1, now.registration_mm.shape[2])
        J = (now.columns_mm[use] / sigma[:, None]).reshape(len(R), -1)[:, free]
        return without(np.column_stack([(now.residual_mm[use] / sigma).ravel(), -J]), R)

    numbers = int(free.sum())
    found = least_squares(
        lambda x: np.concatenate([both(x)[:, 0], prior * x]),
        np.zeros(numbers),
        lambda x: np.concatenate([both(x)[:, 1:], prior * np.eye(numbers)]),
        max_nfev=30,
    )
    theta = np.zeros(count)
    theta[free] = found.x * parameters.prior_std[free]
    return _error_um(other, parameters, theta)


if __name__ == "__main__":
    main()
