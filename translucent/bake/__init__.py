"""Thickness maps: how thick a mesh is under each texel, or each vertex, in metres."""
