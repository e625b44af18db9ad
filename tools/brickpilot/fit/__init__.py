"""Fits a model to measured runs by simulation: parameters, residuals, the descent, and how certain the result is."""
