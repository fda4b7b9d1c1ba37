"""All hard cases, each measured against its promise."""

from __future__ import annotations

from collections.abc import Iterator

from translucent.bench.hard import geometry as hard_geometry
from translucent.bench.hard import interfaces as hard_interfaces
from translucent.bench.hard import scattering as hard_scattering
from translucent.bench.hard import values as hard_values
from translucent.bench.hard import views as hard_views
from translucent.bench.hard.cases import Hard
from translucent.bench.record import HardCase
from translucent.renderer import Renderer

#: All hard cases, in their order. Who needs their number or their names takes them from here.
CASES: tuple[Hard, ...] = tuple(
    sorted(
        (*hard_values.CASES, *hard_views.CASES, *hard_geometry.CASES, *hard_interfaces.CASES, *hard_scattering.CASES),
        key=lambda case: case.id,
    )
)


def measure_hard_cases(renderer: Renderer) -> Iterator[HardCase]:
    """Measure all hard cases, in their order."""
    for case in CASES:
        yield case.measure(renderer)
