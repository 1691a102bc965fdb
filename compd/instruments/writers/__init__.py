"""What instruments write, written: samples and points in each shape, and target lists for instrument and controller."""
