"""Recordings of frames: the passes of the renderer run once without OpenGL, and what they ask of it is written down."""

from __future__ import annotations
