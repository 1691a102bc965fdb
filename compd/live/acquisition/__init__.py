"""Gauges are polled here: one thread per line, which puts readings into `Latest`."""
