"""Every driver against every fault that a wire can have: `compd driver test`."""
