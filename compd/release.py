"""The release of this installation, as it is written into files and messages."""

from importlib.metadata import version

__version__ = version("compd")
