"""Tests of drivers against every fault of a wire: `compd driver test`."""
