"""Text for people and programs: numbers with units, lines of a fixed number, JSON, bytes with escapes."""
