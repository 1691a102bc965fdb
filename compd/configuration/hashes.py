"""Hashes of a configuration, repeated in recordings, models and machine zero; equal for equivalent settings."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from compd.line_settings import LOCAL_BACK_OFF_S, NETWORK_BACK_OFF_S
from compd.operation_settings import TargetSettings, VoteSettings

# Keys about the trust in a gauge, not its value.
NOT_IN_ZERO = (
    *("noise_um", "noise", "acceleration_mm_per_s2", "absolute", "restart_s", "trust_after_loss"),
    *("plausible", "fastest_change", "apart", "tolerance_mm", "sha256"),
)
# Options of later releases, with their neutral values.
_LATER_OPTIONS: Mapping[str, Any] = {
    "fastest_mm_per_s": None,
    "acceleration_mm_per_s2": None,
    "absolute": None,
    "restart_s": 0.5,
    "trust_after_loss": False,
    "allow": [],
    "token_file": None,
    "target": TargetSettings().model_dump(mode="json"),
    "pause_s": 0.0,
    "echo": False,
    "dtr": None,
    "rts": None,
    "rs485": None,
    "ask_one_more": True,
    "skip_bytes": 0,
    "signal_periods": True,
    "break_s": None,
    "line_needs": {},
    "dtr_pulse_s": None,
    "cable": "duplex",
    "decimal_mark": ".",
    "requests": [],
    "at_byte": 0,
    "mask": None,
    "shift": 0,
    "minus": None,
    "function": None,
    "identity": None,
    "write_first": [],
    "write_before_poll": [],
    "extrapolate": True,
    "skew_s": None,
    "round_trigger": None,
    "gateway_wait_s": None,
    "wake_latency_us": None,
    "plausible": None,
    "fastest_change": None,
    "apart": None,
    "standing_temperature_K": VoteSettings().standing_temperature_K,
    "tip_error_um": None,
    "tip_correction_mm": None,
    "rotation_correction_rad": None,
    "frame_drift_um": None,
    "tolerance_mm": None,
    "actuators": [],
    "rods": [],
    "hinges": [],
    "target_fixes": [],
}
# Speed limits (mm/s) of drivers up to 0.2.0, which were part of the hashes.
_FORMER_SPEED_LIMITS: Mapping[str, float] = {
    "heidenhain_nd28x": 200.0,
    **dict.fromkeys(
        (
            "keyence_gt2_dlrs1a",
            "keyence_dlen1",
            "mahr_c1202",
            "serial_ascii",
            "serial_frame",
            "sylvac_optors",
            "tesa_tt80",
        ),
        0.5,
    ),
}


def hash_of(configuration: object, fields: tuple[str, ...], without: tuple[str, ...] = ()) -> str:
    """First 16 hexadecimal digits of the SHA-256 of these fields as JSON, the keys in `without` left out."""

    def plain(value: Any) -> Any:
        if isinstance(value, BaseModel):
            value = value.model_dump(mode="json")
        if isinstance(value, Mapping):
            return {k: plain(v) for k, v in _stated_options(value).items() if k not in without}
        return [plain(v) for v in value] if isinstance(value, list | tuple) else value

    text = json.dumps({name: plain(getattr(configuration, name)) for name in fields}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _stated_options(options: Mapping[str, Any]) -> dict[str, Any]:
    """The effective options: an omitted option of a later release changes no hash."""
    stated = {k: v for k, v in options.items() if k not in _LATER_OPTIONS or v != _LATER_OPTIONS[k]}
    if tuple(stated.get("back_off_s", ())) == LOCAL_BACK_OFF_S:  # that of a network if left out, up to 0.3.0
        stated["back_off_s"] = NETWORK_BACK_OFF_S
    if "low_latency" in stated:  # false if left out, up to 0.2.0
        stated["low_latency"] = bool(stated["low_latency"])
    if (driver := str(stated.get("driver"))) in _FORMER_SPEED_LIMITS and "fastest_mm_per_s" not in stated:
        stated["fastest_mm_per_s"] = _FORMER_SPEED_LIMITS[driver]
    return stated
