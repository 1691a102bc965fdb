"""List, find, read, watch, poll and describe gauges, and try their drivers."""
