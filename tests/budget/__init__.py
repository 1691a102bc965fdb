"""What the project may weigh: `numbers.yaml` has the limits, `measures` counts, and a test compares."""
