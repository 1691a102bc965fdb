"""What to measure next: the rows that tell rivals apart, chosen among programmes that the machine can run."""
