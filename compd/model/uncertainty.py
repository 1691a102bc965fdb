"""Uncertainty of the tip from the gauges' noise and the fitted numbers' errors, to first order (GUM, JCGM 100:2008).

GUM 5.1.2, for errors that are independent: u^2 = sum_i (c_i u_i)^2 with sensitivity coefficients c_i. GUM 5.2.2, for
fitted numbers, whose errors are correlated: u^2 = g^T V g with their covariance V. The two are independent of each
other, so that their variances add up. An uncertainty that is not known is nan and stays nan in the sum.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from compd.arrays import FloatArray
from compd.model.effects import Port

# The ports at which length gauges are read, in the order in which their variances are added up.
GAUGE_PORTS: tuple[Port, ...] = ("scale", "joint", "frame")


class GaugeNoise(NamedTuple):
    """Standard deviation of one reading of each gauge.

    scale_mm (n,), joint_mm (k,), frame_mm (9,), (6,) of u1..u6 alone, or (0,).
    frame_drift_mm : of the tip along each axis, by what the frame moves unmeasured; 0 with all nine distances.
    quantities : of other gauges by name, in their own unit; one that is not named has an unknown noise.
    how : how the noise was found, for people.
    """

    scale_mm: FloatArray
    joint_mm: FloatArray
    frame_mm: FloatArray
    quantities: Mapping[str, float] = MappingProxyType({})
    how: str = ""
    frame_drift_mm: float = 0.0

    def at_port(self, port: Port) -> FloatArray:
        """Of the gauges of one of GAUGE_PORTS, mm."""
        return {"scale": self.scale_mm, "joint": self.joint_mm, "frame": self.frame_mm}[port]


def gauge_variance(sensitivity: Mapping[Port, FloatArray], noise: GaugeNoise) -> FloatArray:
    """GUM 5.1.2: variance (N, m), in mm2, of m predicted coordinates by the noise of all length gauges.

    sensitivity : (N, m, size) for each of GAUGE_PORTS, mm per mm.

    Example: a tip that moves by 1.2 mm per mm of each of three scales with a noise of 0.1 um, and by nothing else, has
    a variance of 3 (1.2 x 1e-4 mm)^2 and a standard uncertainty of 0.21 um.
    """
    return np.asarray(sum(sensitivity[port] ** 2 @ noise.at_port(port) ** 2 for port in GAUGE_PORTS))


def parameter_variance(derivatives: FloatArray, covariance: FloatArray) -> FloatArray:
    """GUM 5.2.2: variance (N, m) of m predicted coordinates by the errors of P fitted numbers, g^T V g for each.

    derivatives : (N, m, P), of each coordinate by each number.  covariance : (P, P); nan in it makes the variance nan.
    """
    return np.asarray((derivatives @ covariance * derivatives).sum(axis=2))
