"""Putting a recording of gauges and an instrument's export together, by time, order, name or distance."""
