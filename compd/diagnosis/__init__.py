"""Which physical effect is missing from a model, how sure that is, and what to measure next."""
