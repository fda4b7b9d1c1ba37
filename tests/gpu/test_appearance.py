"""A mesh rendered in the medium found for it has the color that was asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from translucent.assets import mesh_path
from translucent.frames.appearance import average_color, medium_for_average_color, thickness_samples

SIZE = (96, 72)


def _check(renderer: tl.Renderer, mesh: tl.Mesh, color: str | tuple[float, ...]) -> None:
    target = tl.Medium.from_color(color, 1.0).transmittance(1.0)
    first = renderer.render(tl.showcase(mesh, size=SIZE, stage="none"), SIZE)
    medium = medium_for_average_color(first, color)
    frame = renderer.render(tl.showcase(mesh, medium, SIZE, stage="none"), SIZE)
    seen = frame.transmittance[frame.coverage & frame.valid].mean(axis=0, dtype=np.float64)
    # 1e-3 cannot be seen; what is left is the float32 of the picture, some 1e-7 per unit of optical depth.
    assert np.abs(seen - target).max() < 1e-5
    # The color at any one distance is another: without the averaging, this would not hold.
    alone = tl.Medium.from_color(color, float(thickness_samples(first).mean()))
    assert np.abs(average_color(first, alone) - target).max() > 1e-2


@pytest.mark.parametrize("color", [(0.18, 0.62, 0.35), "#7b1e3a", (0.01, 0.5, 1.0)], ids=str)
@pytest.mark.parametrize("name", ["bear", "knot"])
def test_the_rendered_mean_is_the_target(renderer: tl.Renderer, name: str, color: str | tuple[float, ...]) -> None:
    _check(renderer, tl.load_mesh(mesh_path(name)), color)


def test_the_rendered_mean_of_a_scan_is_the_target(renderer: tl.Renderer, assets: Path) -> None:
    bunnies = sorted(path for path in assets.rglob("*bunny*") if path.suffix in (".obj", ".ply", ".stl", ".off"))
    if not bunnies:
        pytest.skip(f"no bunny in {assets}")
    _check(renderer, tl.load_mesh(bunnies[0]), (0.3, 0.6, 0.2))
