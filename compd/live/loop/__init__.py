"""The compute loop: from a snapshot of readings to a setpoint, at a fixed rate."""
