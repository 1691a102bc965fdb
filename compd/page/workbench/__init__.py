"""The workbench in the browser: a recording against the model, and what is tried on it by hand."""
