"""Axes of what an instrument measures: the names of the columns of its values."""

POSITION_AXES = ("x", "y", "z")
ATTITUDE_AXES = ("rx", "ry", "rz")
POSE_AXES = (*POSITION_AXES, *ATTITUDE_AXES)
LENGTH_AXES = ("length",)
