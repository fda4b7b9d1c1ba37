"""Shadows and caustics in the report: what lights throw through things, against the reference."""
