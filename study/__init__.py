"""Identify nonlinear equations of motion by reverse dynamic MI/SO analysis (Bendat, Palo, Coppolino, 1990)."""

__version__ = "0.1.0"
