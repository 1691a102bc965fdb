"""A recording in the model's frame: registration, velocities, tool positions and link lengths, row by row."""
