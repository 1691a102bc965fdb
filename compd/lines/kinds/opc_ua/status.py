"""OPC UA status codes as qualities: Good has a value, Uncertain and Bad have a reason why there is none.

An uncertain value is no measurement: what it is instead (the last one, a substitute, of a sensor that is not accurate)
is its reason. A good value that was entered by hand, or that stands at a limit of the source's range, is none either.

Source: OPC 10000-4 1.05, 7.39 (severity, sub-codes, limit bits), and OPC 10000-8 1.05, 6.3 (those of DataAccess).
"""

from __future__ import annotations

from collections.abc import Mapping

from asyncua import ua
from asyncua.ua.status_codes import StatusCodes

from compd.gauge import Quality

GOOD, UNCERTAIN = 0, 1  # the two highest bits; 2 and 3 are bad
SEVERITY_SHIFT = 30
SUB_CODE = 0xFFFF0000
# The low half counts where its type says that it belongs to a value.
INFO_TYPE, IS_DATA_VALUE = 0x0C00, 0x0400
LIMIT, AT_LOW, AT_HIGH, CONSTANT = 0x0300, 0x0100, 0x0200, 0x0300

_QUALITIES: Mapping[int, Quality] = {
    StatusCodes.GoodLocalOverride: Quality.SENSOR_FAULT,
    StatusCodes.GoodNoData: Quality.SENSOR_FAULT,
    StatusCodes.UncertainLastUsableValue: Quality.STALE,
    StatusCodes.UncertainNoCommunicationLastUsableValue: Quality.STALE,
    StatusCodes.UncertainSubstituteValue: Quality.SENSOR_FAULT,
    StatusCodes.UncertainSensorNotAccurate: Quality.SENSOR_FAULT,
    StatusCodes.UncertainSensorCalibration: Quality.SENSOR_FAULT,
    StatusCodes.UncertainSubNormal: Quality.SENSOR_FAULT,
    StatusCodes.UncertainSimulatedValue: Quality.SENSOR_FAULT,
    StatusCodes.UncertainTransducerInManual: Quality.SENSOR_FAULT,
    StatusCodes.UncertainEngineeringUnitsExceeded: Quality.OVER_RANGE,
    StatusCodes.UncertainOverRange: Quality.OVER_RANGE,
    StatusCodes.UncertainUnderRange: Quality.UNDER_RANGE,
    StatusCodes.BadSensorFailure: Quality.SENSOR_FAULT,
    StatusCodes.BadNotConnected: Quality.SENSOR_FAULT,
    StatusCodes.BadNoData: Quality.SENSOR_FAULT,
}
_AT_A_LIMIT: Mapping[int, tuple[Quality, str]] = {
    AT_LOW: (Quality.UNDER_RANGE, "at its low limit"),
    AT_HIGH: (Quality.OVER_RANGE, "at its high limit"),
    CONSTANT: (Quality.SENSOR_FAULT, "cannot move"),
}


def quality_of(code: int) -> tuple[Quality, str]:
    """Quality and detail of a value with this status code (32 bits): OK and "", or a reason with the code's name."""
    sub_code = code & SUB_CODE
    severity = code >> SEVERITY_SHIFT
    quality = _QUALITIES.get(sub_code, Quality.OK if severity == GOOD else Quality.DEVICE_ERROR)
    detail = ua.StatusCode(ua.UInt32(sub_code)).name
    limit = _AT_A_LIMIT.get(code & LIMIT) if code & INFO_TYPE == IS_DATA_VALUE else None
    if limit is not None:
        detail = f"{detail}, {limit[1]}"
        if quality in (Quality.OK, Quality.OVER_RANGE):
            quality = limit[0]
    return quality, "" if quality is Quality.OK else detail
