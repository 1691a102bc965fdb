"""How the doctor looks at the other end of a line: at a serial port, at a device of the network."""
