"""A diagnosis in words: one sentence, twelve lines, what to do next, and the phrases of which they are made."""
