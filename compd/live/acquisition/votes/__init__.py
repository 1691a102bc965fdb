"""What the length gauges of a machine say of each other: one module for each kind of contradiction."""
