"""List physical causes, add them to a model file, and take the file into the running daemon."""
