"""The main job on a simulated machine, as `compd demo` shows it."""
