"""Whatever is in a file or on a socket, compd answers, or says what is wrong in its own words, and goes on.

Each test is bounded: a few hundred examples that are always the same. `COMPD_FUZZ=N` tries N times as many, other ones
in every run.
"""
