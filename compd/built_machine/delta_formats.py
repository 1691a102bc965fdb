"""Settings of a delta as the text that a controller reads.

Sources: Klipper, "Config reference", sections `printer` (delta) and `stepper_a`; RepRapFirmware, "G-codes", M665 and
M666; LinuxCNC, manual page lineardeltakins(9) and "INI configuration", section JOINT.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from compd.arrays import FloatArray
from compd.built_machine.delta_fit import FORMS, DeltaSettings
from compd.text import join_words

# A turn below this moves nothing by a nanometre within a metre.
_NO_TURN_RAD = 1e-9
# Six decimals of a mm are 1 nm, and the error at the tip some times that.
_LEAST_UM = 0.01


def settings_text(controller: str, settings: DeltaSettings, machine: str) -> str:
    """The text for a controller of `FORMS`, with comments that say what it costs and what has no setting.

    machine : its name, for the first line.
    """
    comment, body = _TEXTS[controller]
    lines = [f"{comment} {line}".rstrip() for line in _remarks(settings, machine)]
    return "\n".join([*lines, *body(settings)]) + "\n"


def _remarks(settings: DeltaSettings, machine: str) -> list[str]:
    form, shift = settings.form, settings.shift_M_mm
    low, high = settings.heights_M_mm
    towers = join_words(
        [f"{axis} is actuator {i + 1}" for axis, i in zip(form.axes, settings.actuators, strict=True)], "and"
    )
    said = [
        f"{machine} as a linear delta for {form.title}; mm and degrees. Towers: {towers}.",
        f"Error of the tip by what these settings cannot hold: {_um(settings.rms_um)} um rms, "
        f"{_um(settings.worst_um)} um at most, within {settings.radius_of_workspace_mm:.0f} mm of the centre, "
        f"z {low:.0f} to {high:.0f} mm of {{M}}.",
        f"The endstops are where the machine's scales show "
        f"{', '.join(f'{value:g}' for value in settings.endstop_scale_mm)} mm.",
        f"The controller's origin is at {', '.join(_fixed(value) for value in shift)} mm of {{M}}.",
    ]
    if abs(settings.turn_rad) > _NO_TURN_RAD:
        said.append(
            f"Its x axis is turned by {math.degrees(settings.turn_rad):.5f} degrees about z of {{M}}; no setting here "
            "holds that: a work coordinate system does."
        )
    for axis, gain in zip(form.axes, settings.gains, strict=True):
        if gain != 1.0:
            said.append(f"Tower {axis} goes {gain:.7f} times as far as its steps say: {_GAIN[form.title]}.")
    return said


def _klipper(settings: DeltaSettings) -> list[str]:
    """`position_endstop` is the height of the tip at the centre with all carriages at this tower's endstop."""
    lines = ["[printer]", "kinematics: delta", f"delta_radius: {_fixed(settings.radius_mm)}"]
    above = _tip_heights_mm(settings)
    for i, axis in enumerate(settings.form.axes):
        lines += [
            "",
            f"[stepper_{axis}]",
            f"position_endstop: {_fixed(above[i])}",
            f"angle: {_fixed(settings.angle_deg[i])}",
            f"arm_length: {_fixed(settings.arm_mm[i])}",
        ]
    return [*lines, "", "[delta_calibrate]", f"radius: {settings.radius_of_workspace_mm:.1f}"]


def _reprapfirmware(settings: DeltaSettings) -> list[str]:
    """H is the mean height of the tip with all carriages at their endstops, M666 what each differs from it."""
    arms = ":".join(f"{_fixed(value)}" for value in settings.arm_mm)
    above = _tip_heights_mm(settings)
    turns = settings.angle_deg - np.array(settings.form.angles_deg)
    turned = " ".join(f"{axis}{_fixed(turn)}" for axis, turn in zip(settings.form.axes, turns, strict=True))
    moved = " ".join(f"{axis}{_fixed(own)}" for axis, own in zip(settings.form.axes, above - above.mean(), strict=True))
    radius, percent = settings.radius_of_workspace_mm, 100.0 * settings.tilt
    return [
        f"M665 L{arms} R{_fixed(settings.radius_mm)} B{radius:.1f} H{_fixed(above.mean())} {turned}",
        f"M666 {moved} A{_fixed(percent[0])} B{_fixed(percent[1])}",
    ]


def _linuxcnc(settings: DeltaSettings) -> list[str]:
    """The pins are for a HAL file, the sections for the INI file."""
    lines = [
        f"setp lineardeltakins.R {_fixed(settings.radius_mm)}",
        f"setp lineardeltakins.L {_fixed(settings.arm_mm[0])}",
        "# the sections below belong into the INI file",
    ]
    for axis, height in zip(settings.form.axes, settings.endstop_mm, strict=True):
        lines += [f"[JOINT_{axis}]", f"HOME_OFFSET = {_fixed(height)}"]
    return lines


def _fixed(value: float) -> str:
    """To 1 nm, or a millionth of a degree; 0 without a sign."""
    return f"{round(float(value), 6) + 0.0:.6f}"


def _um(value: float) -> str:
    """An error with three digits, and no more than there is in the settings' six decimals."""
    return f"{value:.3g}" if value >= _LEAST_UM else f"less than {_LEAST_UM:g}"


def _tip_heights_mm(settings: DeltaSettings) -> FloatArray:
    """(3,) height of the tip at the centre with the carriage of each tower at its endstop."""
    return np.asarray(settings.endstop_mm - np.sqrt(settings.arm_mm**2 - settings.radius_mm**2))


# How a comment begins, and the lines below the comments.
_TEXTS: Mapping[str, tuple[str, Callable[[DeltaSettings], list[str]]]] = {
    "klipper": ("#", _klipper),
    "reprapfirmware": (";", _reprapfirmware),
    "linuxcnc": ("#", _linuxcnc),
}
# Where a gain belongs that the settings have no number for.
_GAIN: Mapping[str, str] = {
    FORMS["klipper"].title: "multiply its rotation_distance by that",
    FORMS["reprapfirmware"].title: "divide its steps per mm (M92) by that",
    FORMS["linuxcnc"].title: "divide its SCALE (steps per unit) by that",
}
