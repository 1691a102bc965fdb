"""What clients see: sockets, messages, requests, and what is done on request beside the loop."""
