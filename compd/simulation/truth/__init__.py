"""The machine itself: mechanism, heat, joints, frame, sensors, motion, and the protocol of a cause."""
