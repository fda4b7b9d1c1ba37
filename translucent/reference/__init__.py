"""Ground truth in float64 on the CPU, independent of any GPU: `render`, and the hits and intervals below it."""

from translucent.reference.hits import Hits, camera_hits, line_hits
from translucent.reference.intervals import Intervals, scene_intervals
from translucent.reference.render import hit_counts, render

__all__ = ["Hits", "Intervals", "camera_hits", "hit_counts", "line_hits", "render", "scene_intervals"]
