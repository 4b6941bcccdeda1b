"""From a record and a model to coefficients with their errors."""
