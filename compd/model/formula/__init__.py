"""Effects written as formulas: parsed, checked and evaluated without executing any of their text."""
