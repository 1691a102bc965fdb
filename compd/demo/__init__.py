"""The main job on a simulated machine: simulation, daemon and controller side by side, as `compd demo` shows it."""
