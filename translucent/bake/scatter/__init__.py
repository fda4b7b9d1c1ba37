"""Baked light that bodies give back after scattering, as coefficients of the light around them."""
