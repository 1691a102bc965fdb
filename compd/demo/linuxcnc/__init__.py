"""LinuxCNC on a simulated machine: its motor commands move that machine, and compd corrects them."""
