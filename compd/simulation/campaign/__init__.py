"""PlanMotion campaigns on the simulated machine, without wires and without waiting."""
