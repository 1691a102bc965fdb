"""Every fault in every situation, and pairs of faults, held against the bound that each setpoint states."""
