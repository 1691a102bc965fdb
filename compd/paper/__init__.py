"""The experiments of the paper (T. Oiwa), again, on the simulated machine."""
