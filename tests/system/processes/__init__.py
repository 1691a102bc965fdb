"""The daemon's processes, from outside: what a misbehaving driver, a killed or a stopped process does to setpoints.

Every client here watches all setpoints and holds each to the rules of `tests.support.watching.broken_rules`. No time
is asserted that a loaded computer could not keep; the figures are printed, and measured in tests/benchmarks.
"""
