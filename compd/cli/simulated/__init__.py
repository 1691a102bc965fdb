"""The simulated machine: the commands of this panel of `compd --help`, one module each."""
