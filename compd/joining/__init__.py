"""Putting a recording of gauges and an instrument's export together, by time, by order or by name."""
