"""The section `reference:` of a sidecar: what the reference instrument measured, in which unit and how well."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, ValidationInfo, WithJsonSchema, field_validator, model_validator

from compd.columns import AXES
from compd.documents import Section, refusal
from compd.units import REFERENCE_UNITS

Quantity = Literal["tool_position", "tool_pose", "link_length", "ball_plate", "distance", "fixed_point"]
Frame = Literal["machine", "instrument"]
# Quantities measured from, or at, an unknown place: it is fitted along, so that no frame is named.
OF_FIXED_PLACES = ("distance", "fixed_point")

_SIGMA_SCHEMA = {"type": "number", "exclusiveMinimum": 0}
StandardUncertainty = Annotated[
    tuple[float, ...], WithJsonSchema({"anyOf": [_SIGMA_SCHEMA, {"type": "array", "items": _SIGMA_SCHEMA}]})
]


def sigma_key(unit: str) -> str:
    """The key that holds the standard uncertainty of a reference in `unit`."""
    return "sigma_um" if unit == "um" else "sigma"


class Reference(Section):
    """The measured quantity. An unknown uncertainty is nan; `balls` is relative to the sidecar."""

    quantity: Quantity = Field(
        description="what was measured: the tip, the tip and the attitude, the links' change, balls of a ball plate, "
        "the distance from the tip to a fixed ball, or the tip in a fixed pin"
    )
    unit: Annotated[str, WithJsonSchema({"enum": list(REFERENCE_UNITS)})] = Field(
        default="um",
        description="unit of every error. um: the columns are in mm. Another unit, with `machine: external` only: the "
        "columns reference_... and model_... are in this unit too, and their names end in it: reference_x_arcsec, "
        "model_x_arcsec (um/m is written _um_per_m). A formula gives the error in this unit",
    )
    frame: Frame = Field(
        default="machine",
        validate_default=True,
        description="machine: the coordinates are in {M}; instrument: in the instrument's own frame, so that a "
        "registration of six parameters is always fitted; of a ball plate always instrument unless it is written; of "
        "distance and fixed_point there is none",
    )
    sigma_um: StandardUncertainty = Field(
        default=(math.nan,),
        description="standard uncertainty of the reference, um: one number, or one for each axis; left out where it is "
        "not known",
    )
    sigma: StandardUncertainty = Field(
        default=(math.nan,), description="in place of `sigma_um` where `unit` is not um: the same in that unit"
    )
    balls: Path | None = Field(
        default=None,
        validate_default=True,
        description="ball_plate only: the ball plate's file, relative to the sidecar",
    )

    sigma_urad: float = Field(
        default=math.nan,
        description="tool_pose only: standard uncertainty of the attitude, urad, about each axis; with it "
        "the attitude counts beside the tip; beside `sigma_um` alone it is only compared",
    )
    absolute: bool = Field(
        default=False,
        description="distance only: true for a calibrated length; without it a constant is fitted to the length from "
        "each fixed end",
    )
    radius_mm: float | None = Field(
        default=None,
        description="distance only: the same distance in every row, in place of the column `reference_distance_mm`: "
        "the radius of a calibrated ball and that of the probe that touches it",
    )

    reflectors: dict[str, tuple[float, float, float]] | None = Field(
        default=None,
        description="tool_position only: by the name in the column `reflector`, where each reflector is on the "
        "platform, from the tip along the axes of {P}, mm",
    )

    @property
    def of_fixed_places(self) -> bool:
        """Whether fixed ends or pins of unknown place were measured."""
        return self.quantity in OF_FIXED_PLACES

    @property
    def standard_uncertainty(self) -> tuple[float, ...]:
        """One number, or one for each axis, in `unit`; nan if unknown."""
        return self.sigma_um if self.unit == "um" else self.sigma

    @field_validator("quantity", mode="before")
    @classmethod
    def _known_quantity(cls, quantity: Any) -> Any:
        return _one_of(quantity, get_args(Quantity), "name the measured quantity")

    @model_validator(mode="before")
    @classmethod
    def _mapping(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            raise refusal("must hold `quantity:` and what belongs to it", next_step="see the format")
        # a key without a value counts as missing; the frame's default depends on the quantity
        return {"quantity": None, "frame": None, **{key: value for key, value in data.items() if value is not None}}

    @field_validator("unit", mode="before")
    @classmethod
    def _unit_of_the_quantity(cls, unit: Any, info: ValidationInfo) -> Any:
        quantity = info.data.get("quantity")
        if quantity in ("tool_pose", "ball_plate", *OF_FIXED_PLACES) and unit != "um":
            raise refusal(f"of {quantity} is um", "um, or nothing", "delete it")
        return _one_of(unit, tuple(REFERENCE_UNITS), "give the values in one of these")

    @field_validator("frame", mode="before")
    @classmethod
    def _frame_of_the_quantity(cls, frame: Any, info: ValidationInfo) -> Any:
        quantity, unit = info.data.get("quantity"), info.data.get("unit", "um")
        if frame is None and quantity in ("link_length", "ball_plate", *OF_FIXED_PLACES):
            return "machine" if quantity == "link_length" else "instrument"
        if quantity in OF_FIXED_PLACES:
            raise refusal("the fixed place is not known in any frame: it is fitted along", "nothing", "delete it")
        if quantity == "link_length" and frame == "instrument":
            raise refusal("a link's length has no frame", "machine, or nothing", "delete it")
        if unit != "um" and frame in (None, "machine"):
            return "machine"
        if unit != "um" and frame == "instrument":
            raise refusal(f"only lengths have a frame to be fitted, not {unit}", "machine, or nothing", "delete it")
        return _one_of(frame, get_args(Frame), "name the frame of the reference columns")

    @field_validator("sigma_um", "sigma", mode="before")
    @classmethod
    def _standard_uncertainties(cls, sigma: Any, info: ValidationInfo) -> Any:
        unit = info.data.get("unit", "um")
        key = sigma_key(unit)
        if info.field_name != key:
            raise refusal(f"contradicts the unit {unit}", f"{key}, in {unit}", f"write `{key}:`")
        sigmas = sigma if isinstance(sigma, list) else [sigma]
        numbers = [value for value in sigmas if isinstance(value, int | float) and not isinstance(value, bool)]
        if not sigmas or len(numbers) != len(sigmas) or not all(0 < number < math.inf for number in numbers):
            raise refusal(
                "is no standard uncertainty",
                f"a number greater than 0 in {'micrometres' if unit == 'um' else unit}, or one for each axis: "
                "[0.1, 0.1, 0.3]",
                "leave it out where it is not known",
            )
        return tuple(numbers)

    @field_validator("sigma_urad", mode="before")
    @classmethod
    def _attitude_uncertainty(cls, sigma: Any, info: ValidationInfo) -> Any:
        if sigma is None:
            return math.nan
        _only_of("tool_pose", info)
        return _positive(sigma, "is no standard uncertainty", "a number greater than 0, in urad")

    @field_validator("absolute", mode="before")
    @classmethod
    def _absolute_length(cls, absolute: Any, info: ValidationInfo) -> Any:
        _only_of("distance", info)
        if not isinstance(absolute, bool):
            raise refusal("is neither true nor false", "true, false", "write true for a calibrated length")
        return absolute

    @field_validator("radius_mm", mode="before")
    @classmethod
    def _radius_of_a_touched_ball(cls, radius: Any, info: ValidationInfo) -> Any:
        if radius is None:
            return None
        _only_of("distance", info)
        return _positive(radius, "is no distance", "a number greater than 0, in mm")

    @field_validator("reflectors", mode="before")
    @classmethod
    def _reflectors_of_a_position(cls, reflectors: Any, info: ValidationInfo) -> Any:
        if reflectors is None:
            return None
        _only_of("tool_position", info)
        if info.data.get("unit", "um") != "um":
            raise refusal(f"are places, and the reference is in {info.data['unit']}", next_step="delete it")
        if not isinstance(reflectors, dict) or not reflectors or not all(map(_is_place, reflectors.values())):
            raise refusal(
                "is no list of reflectors with the place of each",
                "{1: [40, 0, -10], 2: [-20, 35, -10]}, in mm from the tip along the axes of {P}",
                "take the places from the platform's drawing, or measure them",
            )
        return {str(name): tuple(map(float, place)) for name, place in reflectors.items()}

    @field_validator("balls", mode="before")
    @classmethod
    def _balls_of_a_ball_plate(cls, balls: Any, info: ValidationInfo) -> Any:
        quantity = info.data.get("quantity")
        if quantity == "ball_plate" and (not isinstance(balls, str) or not balls):
            raise refusal(
                "is missing" if balls is None else "is no file name",
                "a CSV file: ball, x_mm, y_mm, z_mm",
                "name the plate's file, beside the sidecar",
            )
        if quantity not in (None, "ball_plate") and balls is not None:
            raise refusal(f"belongs to ball_plate, not to {quantity}", next_step="delete it")
        return balls


def _one_of(value: Any, names: tuple[str, ...], next_step: str) -> Any:
    if value not in names:
        raise refusal("is missing" if value is None else "is unknown", ", ".join(names), next_step)
    return value


def _only_of(quantity: Quantity, info: ValidationInfo) -> None:
    """Refuse a key of another quantity than the reference's; an unknown key passes."""
    if info.data.get("quantity") not in (None, quantity):
        raise refusal(f"belongs to {quantity}, not to {info.data['quantity']}", next_step="delete it")


def _is_place(place: Any) -> bool:
    """Whether these are three finite numbers."""
    if not isinstance(place, list) or len(place) != len(AXES):
        return False
    return all(isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x) for x in place)


def _positive(value: Any, what: str, allowed: str) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0 < value < math.inf:
        raise refusal(what, allowed, "leave it out where it is not known")
    return float(value)
