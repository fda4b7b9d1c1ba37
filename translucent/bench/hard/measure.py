"""All hard cases, each measured against its promise."""

from __future__ import annotations

from collections.abc import Iterator

from translucent.bench.hard import geometry as hard_geometry
from translucent.bench.hard import interfaces as hard_interfaces
from translucent.bench.hard import scattering as hard_scattering
from translucent.bench.hard import shadows as hard_shadows
from translucent.bench.hard import values as hard_values
from translucent.bench.hard import views as hard_views
from translucent.bench.hard.cases import Hard
from translucent.bench.record import HardCase
from translucent.renderer import Renderer

_ROOMS = (hard_values, hard_views, hard_geometry, hard_interfaces, hard_scattering, hard_shadows)

#: All hard cases, in their order. Who needs their number or their names takes them from here.
CASES: tuple[Hard, ...] = tuple(sorted((case for room in _ROOMS for case in room.CASES), key=lambda case: case.id))


def measure_hard_cases(renderer: Renderer) -> Iterator[HardCase]:
    """Measure all hard cases, in their order."""
    for case in CASES:
        yield case.measure(renderer)
