"""Notebooks: scenes that show themselves, and a viewer whose material and camera are Python objects."""
