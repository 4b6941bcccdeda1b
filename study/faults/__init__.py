"""Faults of the measurement: found beside the physics, corrected, said."""
