"""Records, measured or simulated, and what can be derived from them without a model."""

MOTIONS = ("displacement", "velocity", "acceleration")
