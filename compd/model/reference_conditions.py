"""The conditions at which lengths and indices are stated."""

# ISO 1: lengths are stated at 20 degC.
REFERENCE_TEMPERATURE_degC = 20.0
# ISO 2533 standard atmosphere: at this pressure interferometers' tables have their zero.
REFERENCE_PRESSURE_hPa = 1013.25
