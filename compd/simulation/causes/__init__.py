"""Physical causes that can be hidden in the simulated machine."""
