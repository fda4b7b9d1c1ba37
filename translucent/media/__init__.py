"""What fills bodies: coefficients, presets, densities, and the ways from colors to them."""
