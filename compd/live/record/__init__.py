"""Recording the running daemon, and replaying what was recorded."""
