"""Fits a model to measured runs by simulation: parameters, residuals, descents, and the uncertainty of the result."""
