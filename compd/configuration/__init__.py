"""The machine configuration: written by a person, checked as a whole, never rewritten by the program."""

from compd.configuration.machine_configuration import Configuration, load

__all__ = ["Configuration", "load"]
