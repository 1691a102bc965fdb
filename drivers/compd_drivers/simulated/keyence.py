"""The other ends of two units with GT2 comparator heads: DL-RS1A (RS-232) and DL-EN1 (Ethernet)."""

from __future__ import annotations

import math
from collections.abc import Mapping

from compd_drivers.simulated.shared import CommandDevice

# DL-RS1A
MAX_MM = 199.9990  # display of a head without a value
RS1A_COMMAND_ERROR = "ER,{},00\r\n"
RS1A_GO, RS1A_ALARM = "02", "16"  # judgement of a head: inside its limits, or no value
RS1A_CODES = {"+199.9990": "over_range", "-199.9990": "under_range", "---------": "sensor_fault"}
# DL-EN1
INVALID = -99_999_998
OVER, UNDER = 99_999_999, -99_999_999
EN1_GO, EN1_ERROR = "04", "03"
EN1_CODES = {OVER: "over_range", UNDER: "under_range", INVALID: "sensor_fault", 100_000_000: "sensor_fault"}
EN1_FORMAT_ERROR = "ER,{},255\r\n"


class SimulatedDlRs1a(CommandDevice):
    """Shows its channels `1`, `2` ...; a sensor that is off shows the number for `no value`."""

    terminator = b"\r\n"

    @property
    def error_replies(self) -> Mapping[bytes, str]:
        """Errors of the unit, and the display of every head without a value."""
        request = self.options.request
        replies = {f"ER,{request},{number}\r\n".encode(): "device_error" for number in ("00", "31")}
        state = f",{RS1A_ALARM}" if request == "MS" else ""
        for field, quality in RS1A_CODES.items():
            replies[(request + f"{state},{field}" * self.options.heads + "\r\n").encode()] = quality
        return replies

    def answer(self, command: str) -> str:
        """M0: values; MS: values with each head's judgement; ER for unknown commands."""
        heads_mm = [self.sense(str(head + 1)) for head in range(self.options.heads)]
        match command:
            case "M0":
                fields = [self._shown(mm) for mm in heads_mm]
            case "MS":
                fields = [f"{RS1A_GO if math.isfinite(mm) else RS1A_ALARM},{self._shown(mm)}" for mm in heads_mm]
            case _:
                return RS1A_COMMAND_ERROR.format(command.partition(",")[0][:2])
        return ",".join([command, *fields]) + "\r\n"

    @staticmethod
    def _shown(value_mm: float) -> str:
        if not math.isfinite(value_mm):
            return f"{-MAX_MM:+09.4f}"
        return f"{min(MAX_MM, max(-MAX_MM, value_mm)):+09.4f}"


class SimulatedDlEn1(CommandDevice):
    """Shows its channels `1`, `2` ... as integers with a sign and nine digits; a sensor that is off is invalid."""

    terminator = b"\r\n"

    @property
    def error_replies(self) -> Mapping[bytes, str]:
        """Errors of the unit, and the numbers of every head without a value."""
        replies = {f"ER,MS,{number}\r\n".encode(): "device_error" for number in ("031", "254", "255")}
        for number, quality in EN1_CODES.items():
            replies[("MS" + f",{EN1_ERROR},{number:+010d}" * self.options.heads + "\r\n").encode()] = quality
        return replies

    def answer(self, command: str) -> str:
        """MS: states and values; M0: values alone; ER for unknown commands."""
        heads_mm = [self.sense(str(head + 1)) for head in range(self.options.heads)]
        match command:
            case "MS":
                fields = [f"{EN1_GO if math.isfinite(mm) else EN1_ERROR},{self._shown(mm)}" for mm in heads_mm]
            case "M0":
                fields = [self._shown(mm) for mm in heads_mm]
            case _:
                return EN1_FORMAT_ERROR.format(command[:2])
        return ",".join([command, *fields]) + "\r\n"

    def _shown(self, value_mm: float) -> str:
        if not math.isfinite(value_mm):
            return f"{INVALID:+010d}"
        return f"{min(OVER, max(UNDER, round(value_mm * 10**self.options.decimals))):+010d}"
