"""Memory that the daemon's processes share: made before they are forked, written by one of them, read by the others."""
