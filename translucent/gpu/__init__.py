"""Rendering with OpenGL, which no other package uses."""
