"""compd: live error compensation for parallel kinematic machines, after T. Oiwa."""

from importlib.metadata import version

__version__ = version("compd")
