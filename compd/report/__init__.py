"""Pages that work offline: comparisons, diagnoses, effects."""
