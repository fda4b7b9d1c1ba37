"""Audit of glTF materials that light passes: what a file states against what its meshes are, and its repair."""
