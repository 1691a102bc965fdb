"""Checks of gauges against each other: a class each, and the thread that runs them ten times a second."""
