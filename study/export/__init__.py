"""A model where it goes on: as a Python function, an FMU, a Modelica class."""
