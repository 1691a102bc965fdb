"""Checks of this computer for the daemon: ports, permissions, real time, clock, disk, service.

Everything is looked at and nothing touched: no port is opened, no file written, no device asked. So a daemon that runs
is not disturbed.
"""
