"""Joining a measurement in the page: `compd join` with the mouse."""
