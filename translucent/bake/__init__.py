"""Baking of thickness maps: thickness of a mesh under each texel or vertex, in metres."""
