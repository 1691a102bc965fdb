"""Physical causes that can be hidden in the simulated machine, one module per family."""
