"""Rendering with OpenGL: the only room that touches it."""
