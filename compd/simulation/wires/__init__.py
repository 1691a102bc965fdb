"""The simulated machine on real ports: its gauges on ptys and sockets."""
