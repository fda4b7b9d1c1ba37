"""Scenes from glTF 2.0 files: nodes, meshes, cameras and lights. `translucent.materials` reads their materials."""
