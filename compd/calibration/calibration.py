"""What a calibration says: the machine as built, how sure each number is, and how far its prediction errs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from compd.arrays import FloatArray, IntArray
from compd.calibration.criteria import CalibrationCriteria
from compd.model.effects import FittedEffect
from compd.text import nan_to_null


class CalibratedNumber(NamedTuple):
    """One number of the machine.

    name : as in model files, "base_joint_position.d_3x".  block : the effect's id.  element : "rod 3 base x".
    unit : "mm", "ppm", "urad", or what the effect has.  drawing, value, std : in `unit`; drawing is 0 for what a
    drawing states as perfect, a zero, a gain or a direction's error.  std : posterior, with the tolerance as prior.
    prior_std : before any pose was measured, of the tolerance.
    correlation, with_whom : the largest with another number of the fit, and that one's element; 0 and "" without one.
    needed : whether held-out poses are predicted better with its block.
    held : whether it is the drawing's, or the poses tell it less than twice as well as the tolerance does: it may have
    moved with others.
    """

    name: str
    block: str
    element: str
    unit: str
    drawing: float
    value: float
    std: float
    prior_std: float
    correlation: float
    with_whom: str
    needed: bool
    held: bool

    @property
    def change(self) -> float:
        """value - drawing."""
        return self.value - self.drawing

    @property
    def claimed(self) -> bool:
        """Whether the calibration states this number: the poses tell it."""
        return not self.held


class PoseErrors(NamedTuple):
    """Errors of R poses that took no part in the fit, or of all that did; each after its instrument was registered.

    what : "random poses", "regions", "sealed friday.csv", "monday.csv".  rows : (R,) as a spreadsheet shows them, -1
    where recordings are mixed.
    place_mm : (R, 3) where the tip was, {M}.  before_mm, after_mm : (R, 3) measured less modelled tip, nan where no tip
    was measured.  before_links_mm, after_links_mm : (R, n) the same as errors of links, nan where none can be told.
    before_rms_um, after_rms_um : per coordinate of a length.  before_rms_urad, after_rms_urad : of the attitude; nan.
    """

    what: str
    rows: IntArray
    place_mm: FloatArray
    before_mm: FloatArray
    after_mm: FloatArray
    before_links_mm: FloatArray
    after_links_mm: FloatArray
    before_rms_um: float
    after_rms_um: float
    before_rms_urad: float
    after_rms_urad: float


class HeldCombination(NamedTuple):
    """A combination of numbers that these poses cannot tell, and that stays at the drawing.

    words : what it is.  remedy : the poses or the measurement that would tell it.
    weights : (P,) of the calibration's numbers, each over its prior; a unit vector.
    share : its standard deviation after the poses over that before, near 1.
    """

    words: str
    remedy: str
    weights: FloatArray
    share: float


class TriedBlock(NamedTuple):
    """A block of numbers, as held-out poses judge it.

    name : the effect's id.  words : "places of the base joints".  needed : it is in the calibration.
    without, with_it : error of held-out poses, in standard deviations of the noise, rms, without it and with it; of
    random poses and of regions together.  why : why it is in, or not, in words.
    """

    name: str
    words: str
    needed: bool
    without: float
    with_it: float
    why: str


class GrossPose(NamedTuple):
    """A pose with an error that no noise explains; it is left out.  row : as a spreadsheet shows it."""

    recording: str
    row: int
    error_mm: float


class PredictionSlice(NamedTuple):
    """The prediction's standard error on a grid of two coordinates, the others held.

    across, up : names of the coordinates: "x", "y", "z", or "a", "b", "c" of turns about these.
    held : the others that a target fixes, in words.
    across_at : (A,) and up_at : (B,), mm of a place in {M}, rad of a turn since machine zero.
    std_um, std_urad : (B, A), as those of `PredictionMap`; nan where the machine does not reach.
    """

    across: str
    up: str
    held: str
    across_at: FloatArray
    up_at: FloatArray
    std_um: FloatArray
    std_urad: FloatArray


class PredictionMap(NamedTuple):
    """How uncertain the calibrated machine's prediction is over the workspace, from the covariance of all numbers.

    What is held at the drawing counts with its tolerance. The rigid motion of the whole machine that fits the tips of
    the M measured poses best is left out, as an instrument's frame takes it, and of attitudes the turn that fits all.
    Noise of a single measurement is not in it.

    place_mm, turn_rad : (R, 3) poses spread evenly over what the machine reaches: tip in {M}, turn since machine zero.
    std_um, std_urad : (R,) standard errors of the tip and of the attitude, in space: the root of the sum over x, y, z.
    measured_mm, measured_rad : (M, 3) the poses that were measured.  measured_std_um, measured_std_urad : (M,) there.
    slices : through the middle of the workspace, through places first.
    """

    place_mm: FloatArray
    turn_rad: FloatArray
    std_um: FloatArray
    std_urad: FloatArray
    measured_mm: FloatArray
    measured_rad: FloatArray
    measured_std_um: FloatArray
    measured_std_urad: FloatArray
    slices: tuple[PredictionSlice, ...]

    @property
    def words(self) -> str:
        """Median, largest and where, in a sentence."""
        worst = int(self.std_um.argmax())
        x, y, z = self.place_mm[worst]
        largest = f"{self.std_um[worst]:.3g} um at x {x:.0f}, y {y:.0f}, z {z:.0f} mm"
        turn = np.degrees(np.linalg.norm(self.turn_rad[worst]))
        turned = f", turned by {turn:.0f} deg" if turn > 0 else ""
        return (
            f"Standard error of the predicted tip over the workspace, in space: median "
            f"{np.median(self.std_um):.3g} um, "
            f"largest {largest}{turned}; at the measured poses {np.median(self.measured_std_um):.3g} um (median)."
        )


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """The machine as built, from its drawing and measured poses; P numbers of all blocks that were tried."""

    machine: str  #: its name
    recordings: tuple[str, ...]  #: the files that it was learned from
    #: P numbers, of needed and of other blocks, in the order of the blocks and of `covariance`
    numbers: tuple[CalibratedNumber, ...]
    covariance: FloatArray  #: (P, P) array: of the values, in their units: the mean square of their errors
    #: the blocks of the machine as built as effects of a model, from which predictions follow; each with its
    #: covariance: all that the drawing states and poses can test, and needed ones
    fitted: tuple[FittedEffect, ...]
    fitted_covariance: FloatArray  #: (Q, Q) array: of their parameters jointly, in the order of `fitted`
    blocks: tuple[TriedBlock, ...]  #: what was tried, in order of trial
    learned: tuple[PoseErrors, ...]  #: of the poses that it was learned from, one for each recording
    held_out: tuple[PoseErrors, ...]  #: of random poses, and of whole regions, that the numbers were not learned from
    sealed: tuple[PoseErrors, ...]  #: of recordings that were opened last; registered alone
    held: tuple[HeldCombination, ...]  #: what these poses cannot tell
    gross: tuple[GrossPose, ...]  #: poses left out
    #: whatever a reader must know before he trusts it: a scale of length that is not in the data, poses that are all at
    #: one height
    warnings: tuple[str, ...]
    noise_um: float  #: noise_um, noise_urad: of the measurement, per coordinate; nan where nothing says it
    noise_urad: float
    left_over: float  #: variance of held-out errors over that of the noise; 1 where only noise is left
    #: (w,) array: standard deviation of what is left of the first recording, of each coordinate that was weighed: a
    #: urad of an attitude as a um
    sigma_mm: FloatArray
    #: whether poses were weighed as errors of links, which then have one scatter: the machine errs more than the
    #: instrument
    in_links: bool
    #: block, and by which factor the tolerance was scaled to fit what the poses tell of it
    prior_scale: dict[str, float]
    #: how uncertain the prediction is over the workspace; None for a tool that stands on the plate
    prediction: PredictionMap | None

    @property
    def verdict(self) -> str:
        """The result in a sentence."""
        random = self.held_out[0]
        needed = [block.words for block in self.blocks if block.needed]
        if not needed:
            return f"{self.machine}: no number of the drawing is told better by these poses; it stays as drawn."
        return (
            f"{self.machine}: the error at poses that were left out falls from {random.before_rms_um:.3g} to "
            f"{random.after_rms_um:.3g} um (rms per coordinate), with {', '.join(needed)}."
        )

    @property
    def diagnose_next(self) -> bool:
        """Whether `compd diagnose` should go on: more than noise is left."""
        return bool(np.isfinite(self.left_over) and self.left_over > CalibrationCriteria.left_over)

    def as_json(self) -> dict[str, Any]:
        """What `compd calibrate --json` prints, as plain data; nan is None."""
        return dict(
            nan_to_null(
                {
                    "machine": self.machine,
                    "recordings": list(self.recordings),
                    "verdict": self.verdict,
                    "numbers": [{**number._asdict(), "claimed": number.claimed} for number in self.numbers],
                    "covariance": self.covariance.tolist(),
                    "blocks": [block._asdict() for block in self.blocks],
                    **{
                        part: [_plain(errors) for errors in getattr(self, part)]
                        for part in ("learned", "held_out", "sealed")
                    },
                    "held": [
                        {"words": one.words, "remedy": one.remedy, "share": one.share, "weights": one.weights.tolist()}
                        for one in self.held
                    ],
                    "gross": [pose._asdict() for pose in self.gross],
                    "warnings": list(self.warnings),
                    "sigma_mm": self.sigma_mm.tolist(),
                    "in_links": self.in_links,
                    "noise_um": self.noise_um,
                    "noise_urad": self.noise_urad,
                    "left_over": self.left_over,
                    "diagnose_next": self.diagnose_next,
                    "prior_scale": self.prior_scale,
                    "prediction": None if self.prediction is None else _prediction_json(self.prediction),
                }
            )
        )

    def __repr__(self) -> str:
        return f"<Calibration: {self.verdict}>"


def _prediction_json(prediction: PredictionMap) -> dict[str, Any]:
    return {
        "words": prediction.words,
        "median_um": float(np.median(prediction.std_um)),
        "largest_um": float(prediction.std_um.max()),
        "largest_at_mm": prediction.place_mm[prediction.std_um.argmax()].tolist(),
        **_plain(prediction),
        "slices": [_plain(one) for one in prediction.slices],
    }


def _plain(values: PoseErrors | PredictionMap | PredictionSlice) -> dict[str, Any]:
    return {
        name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values._asdict().items()
    }
