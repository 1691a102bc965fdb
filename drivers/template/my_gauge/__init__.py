"""A driver package to copy: driver.py speaks to the device, simulated.py is the device."""
