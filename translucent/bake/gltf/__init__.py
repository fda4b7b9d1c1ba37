"""Baking whole glTF files: what to bake, and how maps and vertices go back into them."""
