"""The public functions that combine several packages, for `import compd` and the commands."""
