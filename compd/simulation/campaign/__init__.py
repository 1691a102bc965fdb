"""Measuring campaigns on the simulated machine, computed without wires or real time."""
