"""Audit of translucent glTF materials: stated thickness against the meshes, and repair of the file."""
