"""A machine that is not there: the commands of this panel of `compd --help`, one module each."""
