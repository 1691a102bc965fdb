"""Shop time with random faults, and without any: what is published, what it costs, what is raised for nothing."""
