"""Baking of whole glTF files: selection of targets, and writing of maps and vertices back."""
