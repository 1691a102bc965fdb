"""The one limit of time in tests: it ends a test that hangs, and measures nothing."""

# Longer than anything takes on a computer on which ten others work. What is waited for comes much sooner.
PATIENCE_S = 120.0
