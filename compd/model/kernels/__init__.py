"""Compiled numerics: one source for one snapshot and for N rows."""
