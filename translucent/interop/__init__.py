"""Interoperation with other renderers, one module each, imported on demand."""
