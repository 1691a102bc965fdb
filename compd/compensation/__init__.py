"""The equations of both modes with effects: from gauge values to corrections, one row or many."""
