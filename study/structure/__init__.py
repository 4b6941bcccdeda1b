"""Structures of several coordinates: their motion under forces, and which effect is missing where."""
