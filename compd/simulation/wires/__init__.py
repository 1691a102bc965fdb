"""The simulated machine on real ports: its gauges on ptys and TCP sockets, each in its own protocol."""
