"""All hard cases, H01 to H29, each measured against its promise."""

from __future__ import annotations

from collections.abc import Iterator

from translucent.bench.hard import geometry as hard_geometry
from translucent.bench.hard import interfaces as hard_interfaces
from translucent.bench.hard import values as hard_values
from translucent.bench.hard import views as hard_views
from translucent.bench.record import HardCase
from translucent.renderer import Renderer


def measure_hard_cases(renderer: Renderer) -> Iterator[HardCase]:
    """Measure all hard cases, in their order."""
    cases = (*hard_values.CASES, *hard_views.CASES, *hard_geometry.CASES, *hard_interfaces.CASES)
    for case in sorted(cases, key=lambda case: case.id):
        yield case.measure(renderer)
