"""Random paths whose hits Embree finds: the paths that shaders follow, however many streams and passes they go in."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from tests.gpu.test_path_traced import SCENES, SIZE, SKY, ball
from translucent.assets import mesh_path
from translucent.geometry.ray_caster import embree_refusal
from translucent.gpu.passes import path_trace

EMBREE, SHADERS = tl.PathTraced(48, 3, hits="embree"), tl.PathTraced(48, 3, hits="gl")
GLASS = tl.Medium(absorption=(0.1, 0.3, 0.6), ior=1.5)

#: Paths at edges, where one of two triangles is as right, may differ from there on.
MOST_OFF, MOST_DIFFERENT = 1e-4, 0.02


@pytest.fixture(autouse=True)
def _embree(renderer: tl.Renderer) -> None:
    if embree_refusal() or not renderer.gpu.capabilities.shader_storage:
        pytest.skip("no Embree, or no compute shaders")


def goblet() -> tl.Scene:
    """Wine in a glass, their walls together."""
    cup, fill = (tl.load_mesh(mesh_path(name)) for name in ("goblet", "wine"))
    glass, wine = tl.Medium(absorption=5.0, ior=1.54), tl.Medium(absorption=80.0, ior=1.34)
    camera = tl.Camera.look_at((0.0, 0.20, 0.62), (0.0, 0.1, 0.0), fov_y=22.0)
    return tl.Scene([tl.Object(cup, glass, priority=1), tl.Object(fill, wine)], camera, [], SKY, "priority")


def inside() -> tl.Scene:
    """The eye is in a ball of frosted glass."""
    camera = tl.Camera.look_at((0.1, 0.0, 0.2), (0.0, 0.0, -1.0), fov_y=90.0)
    return tl.Scene([ball(GLASS, tl.Surface(roughness=0.4))], camera, [], SKY)


NAMES = ("glass in a studio", "frosted glass on a floor", "milk", "ball in a ball", "painted cube in glass")
ALL = {**{name: SCENES[name][0] for name in NAMES}, "goblet": goblet(), "eye inside": inside()}


def assert_same(one: tl.Frame, other: tl.Frame) -> None:
    difference = np.abs(one.radiance.astype(np.float64) - other.radiance)
    mean = float(other.radiance.mean())
    assert difference.mean() < MOST_OFF * mean
    assert (difference.max(axis=2) > MOST_OFF * mean).mean() < MOST_DIFFERENT
    assert one.standard_error is not None
    assert other.standard_error is not None
    assert np.abs(one.standard_error - other.standard_error).mean() < MOST_OFF * mean
    np.testing.assert_array_equal(one.valid, other.valid)


@pytest.mark.parametrize(("name", "samples"), [*((name, 1) for name in ALL), ("frosted glass on a floor", 3)])
def test_the_picture_is_that_of_shaders(name: str, samples: int, renderer: tl.Renderer) -> None:
    size = (24, 20)
    one, other = (renderer.render(ALL[name], size, method, samples=samples) for method in (EMBREE, SHADERS))
    assert one.plan.hits == "embree"
    assert one.provenance["hits"].startswith("Embree")
    assert other.provenance["hits"] == "OpenGL"
    assert_same(one, other)


@pytest.mark.parametrize("most", [1, 200, 1 << 12])
def test_tiles_and_streams_leave_no_trace(most: int, renderer: tl.Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """One stream for each pixel, several with other numbers of paths, and one for each path."""
    scene = ALL["ball in a ball"]
    whole = renderer.render(scene, SIZE, EMBREE)
    monkeypatch.setattr(path_trace, "MOST_STREAMS", most)
    monkeypatch.setattr(path_trace.PathTracer.steps, "__kwdefaults__", {"seconds": 0.1, "tile": 5})
    shares: list[float] = []
    parts = renderer.render(scene, SIZE, EMBREE, progress=shares.append)
    np.testing.assert_allclose(parts.radiance, whole.radiance, rtol=1e-5)
    np.testing.assert_allclose(parts.standard_error, whole.standard_error, rtol=1e-4)  # type: ignore[arg-type]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_paths_without_chance_are_counted_at_once(renderer: tl.Renderer) -> None:
    """Bodies that only absorb: one path of a pixel is as good as all, and there is no noise."""
    scene = tl.Scene([ball(tl.Medium((0.5, 1.0, 2.0), 0.0, (0.1, 0.2, 0.3)))], SCENES["milk"][0].camera, [], SKY)
    one, other = (renderer.render(scene, (24, 24), tl.PathTraced(1000, hits=hits)) for hits in ("embree", "gl"))
    assert_same(one, other)
    assert one.standard_error is not None
    assert one.standard_error.max() < 1e-6
