"""Record readings of the machine, replay them, join an instrument's export; check, change and merge recordings."""
