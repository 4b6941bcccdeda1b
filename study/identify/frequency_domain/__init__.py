"""Identification from spectra of the reverse system: frequency response functions, coherences, coefficients."""
