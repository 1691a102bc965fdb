"""Simulate a machine on real ports, break its lines, measure it with a laser tracker; or a whole measuring campaign."""
