"""The daemon: gauges are read, setpoints computed at a fixed rate, clients served, runs recorded."""
