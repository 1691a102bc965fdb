"""Drivers that are wrong in one way each, and the devices that they are for; `compd gauge test-driver` must find all.

Of each kind of device there is a driver that is right, too: `device` of a driver is the device that it is for.
"""

from __future__ import annotations

from compd.gauge import Gauge
from tests.support.faulty_drivers import blocks, comparator, forms, numbers, replies, requests, talkers, units

DRIVERS: dict[str, type[Gauge]] = {
    name: value
    for module in (comparator, numbers, requests, replies, forms, units, blocks, talkers)
    for name, value in vars(module).items()
    if hasattr(value, "device")
}
