"""Begin the configuration of a machine, draw one, write its numbers for other programs; end the controller's role."""
