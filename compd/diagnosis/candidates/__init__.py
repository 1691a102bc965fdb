"""What may be missing from a model, with the columns that it would add: effects, the constant, proxies, changes."""
