"""Cross-checks between the length gauges of a machine: one module for each kind of contradiction."""
