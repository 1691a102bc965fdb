"""The simulated machine: its mechanism, heat, joints, frame and sensors."""
