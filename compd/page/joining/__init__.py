"""Joining a measurement in the page: `compd recording join` with the mouse."""
