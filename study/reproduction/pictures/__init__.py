"""Figures that the reproduction alone draws: Axes in, Axes out."""
