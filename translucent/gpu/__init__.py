"""The GPU ring: the only code that touches OpenGL."""
