"""A recording: raw readings of a machine beside an external reference, as files and as arrays."""
