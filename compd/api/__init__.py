"""The public functions that put several rooms together: what `import compd` and the commands offer."""
