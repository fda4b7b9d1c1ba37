"""Participating media: coefficients, presets, densities, and conversions from colors."""
