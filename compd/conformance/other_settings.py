"""Options of a gauge with one change: another unit of its kind, or a device with other settings."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from pydantic import ValidationError

from compd.gauge import GaugeOptions


def other_settings(options: GaugeOptions) -> Iterator[tuple[str, GaugeOptions]]:
    """The change ("address=2") and the options, for whole numbers, texts ending in one, choices, switches."""
    for name, field in type(options).model_fields.items():
        if name in GaugeOptions.model_fields:
            continue
        for value in _others(getattr(options, name), field.annotation):
            try:
                other = type(options).model_validate({**options.model_dump(exclude_unset=True), name: value})
            except (ValidationError, ValueError):
                continue
            yield f"{name}={value}", other


def _others(value: Any, annotation: Any) -> list[Any]:
    """Other values of the same kind; [] if unknown."""
    if get_origin(annotation) is Literal:
        return [choice for choice in get_args(annotation) if choice != value]
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int):
        return [value + 1, value - 1]
    if isinstance(value, str) and (digits := re.search(r"\d+$", value)):
        return [value[: digits.start()] + f"{int(digits[0]) + 1:0{len(digits[0])}d}"[-len(digits[0]) :]]
    return []
