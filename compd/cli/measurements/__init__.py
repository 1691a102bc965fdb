"""Learn from measurements: the commands of this panel of `compd --help`, one module each."""
