"""What was measured or simulated, and what can be said of it without a model."""
