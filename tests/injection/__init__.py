"""An injector between a simulated machine and the daemon, and the fault matrix that it is used for."""
