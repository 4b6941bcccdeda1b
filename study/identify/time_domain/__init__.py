"""Identification by free runs of the model under the measured force."""
