"""The diagnosis, scored on simulated machines whose secret only the scorer opens: `make scoreboard`."""
