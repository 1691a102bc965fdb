"""The daemon's parts, a machine and its devices in virtual time: see `tests.worlds.world`."""
