"""Driver threads: one per line, each polls the gauges of its line."""
