"""Description of a gauge without a driver: capture replies, ask for their meaning, write and read back."""
