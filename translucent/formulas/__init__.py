"""Formulas of light and color, each with a twin of the same name in ``shaders/lib/`` where a shader needs it."""
