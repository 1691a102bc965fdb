"""Scores of the diagnosis on simulated machines with hidden causes: `make scoreboard`."""
