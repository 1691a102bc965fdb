"""Covariates: everything recorded or modelled that the residual of a comparison may depend on."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.comparison.alignment.aligned_recording import AlignedRecording
from compd.display_unit import in_place_unit, place_unit
from compd.units import unit_of

# Columns of derivatives, as of the prediction by a parameter.
DERIVATIVE = "d_"
# Units of pure numbers, and words by which people call a number that names something.
_PURE = ("", "1", "counts")
_LABEL_WORDS = frozenset(
    [
        *("row", "line", "index", "number", "no", "nr", "id", "point", "visit", "session", "run", "sample", "sequence"),
        *("star", "target", "hole", "image", "exposure"),
    ]
)


class Covariate(NamedTuple):
    """Something that the residual may follow.

    name : as people read it, without the unit.  unit : "1" for a pure number.
    values : (N,), nan where unknown; a direction is -1 or +1.
    link : the link it belongs to, counted from 1; 0 for none.
    """

    name: str
    unit: str
    values: FloatArray
    link: int = 0

    @staticmethod
    def why_none(name: str, values: FloatArray) -> str:
        """Why nothing can depend on a measured quantity, in words; "" where something can.

        A label is a whole number without unit that names rows or counts up by ones through the recording, as a column
        `star_1` or `run_1` does: everything that changed in time follows it. Two values, off and on, are no label.

        values : (R,) those that are known.
        """
        if name.startswith(DERIVATIVE):
            return "a derivative of the model's prediction, which belongs to an effect"
        if unit_of(name) in _PURE and (values == np.rint(values)).all():
            counts = len(np.unique(values)) > 2 and bool(np.isin(np.diff(values), (0.0, 1.0)).all())
            if counts or _LABEL_WORDS & set(name.lower().split("_")):
                return "only counts or names rows"
        return ""


def covariates(aligned: AlignedRecording) -> list[Covariate]:
    """Time, the tip's place, every measured quantity, gradients of temperature, each link's length and direction."""
    recording, quantities = aligned.recording, aligned.rows.quantities
    result = [Covariate("time", "h", recording.elapsed_s / 3600.0)] if recording.has_time else []
    result += [
        Covariate(axis, place_unit(aligned.unit), in_place_unit(column, aligned.unit))
        for axis, column in zip("xyz", aligned.rows.tip_M_mm.T, strict=True)
        if np.isfinite(column).any()
    ]
    for name, column in quantities.items():
        if Covariate.why_none(name, column[np.isfinite(column)]):
            continue
        unit = unit_of(name)
        if link := _link_of_approach(name):
            of = "link" if aligned.of_links else "axis"
            result.append(Covariate(f"direction of {of} {link}", "1", column, link))
        else:
            result.append(Covariate(name.removesuffix(f"_{unit}"), _difference_unit(unit), column, _link_of(name)))
    for top in [name for name in quantities if name.endswith("_top_degC")]:
        bottom = top.replace("_top_", "_bottom_")
        if bottom in quantities:
            gradient = f"{top.removesuffix('_degC')} - {bottom.removesuffix('_degC')}"
            result.append(Covariate(gradient, "K", quantities[top] - quantities[bottom]))
    if aligned.model is not None:
        for i, length in enumerate(aligned.rows.link_mm.T, start=1):
            result.append(Covariate(f"length of link {i}", "mm", length, i))
    if recording.approach is not None:
        for i, direction in enumerate(recording.approach.T, start=1):
            result.append(Covariate(f"direction of link {i}", "1", direction, i))
    return result


def _link_of_approach(name: str) -> int:
    """The link, or axis of an external model, whose direction of travel a quantity is; 0 for any other quantity."""
    match = re.fullmatch(r"approach_([1-9]\d*)", name)
    return int(match[1]) if match else 0


def _link_of(name: str) -> int:
    """The link that a quantity such as `temperature_link_2_degC` belongs to; 0 for none."""
    for word, number in pairwise(name.split("_")):
        if word == "link" and number.isdigit():
            return int(number)
    return 0


def _difference_unit(unit: str) -> str:
    """The unit of a change of the quantity: of temperatures it is the kelvin."""
    return {"degC": "K", "pct": "%", "": "1"}.get(unit, unit)
