"""Figures of the study: Axes in, Axes out; nothing here saves a file or keeps state between calls.

``page`` lays out a figure and turns it into bytes, ``curves`` holds what is drawn, ``styles`` and
``labels`` give every estimator one look and every axis its unit, the other modules draw.
"""
