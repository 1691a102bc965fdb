"""Formulas of measured quantities that describe what a residual follows; they name no cause."""
