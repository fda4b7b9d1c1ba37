"""Textures that rays read wherever they hit: values to the last texel, mipmaps, and what stays when objects move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import translucent as tl
from translucent.gpu.hierarchies import HierarchyCache, _mipmaps

BLACK = tl.Environment.constant((0.0, 0.0, 0.0))
CAMERA = tl.Camera.orthographic((0, 0, 3), (0, 0, 0), up=(0, 1, 0), height=2.0)
CORNERS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
SIZE = 24


def square(height: float, half: float = 1.0) -> tl.Mesh:
    """A square across the view; its texture coordinates reach beyond 0 to 1 on all sides."""
    vertices = np.column_stack([half * CORNERS, np.full(4, height)])
    uv = (CORNERS + 1.0) / 2.0 * (3.5, 2.6) - (1.3, 0.7)
    return tl.Mesh(vertices, [(0, 1, 2), (0, 2, 3)], uv=uv)


#: Halves all light and bends none, so that a path behind it has no noise.
GRAY = tl.Object(square(1.0, 3.0), tl.Medium(), surface=tl.Surface(color=(0.5, 0.5, 0.5)), sheet_thickness=1e-3)


def screen(texture: tl.Texture) -> tl.Object:
    """An object that emits the light of a texture, and reflects none."""
    surface = tl.Surface(color=(0, 0, 0), ior=1.0, emissive=(1, 1, 1), emissive_texture=texture)
    return tl.Object(square(0.0), None, surface=surface)


@pytest.mark.parametrize(("across", "upwards"), [("repeat", "clamp"), ("clamp", "repeat")])
def test_values_are_those_of_the_texture(
    across: str, upwards: str, renderer: tl.Renderer, rng: np.random.Generator
) -> None:
    """To 16 bits, and where float32 has the place."""
    texture = tl.Texture(
        rng.random((3, 5, 3)), scale=(1.1, 0.8), offset=(0.2, -0.3), rotation=20.0, wrap=(across, upwards)
    )
    scene = tl.Scene([GRAY, screen(texture)], CAMERA, [], BLACK)
    place = (np.arange(SIZE) + 0.5) / SIZE
    u, v = np.meshgrid(3.5 * place - 1.3, 2.6 * place[::-1] - 0.7)
    expected = 0.5 * texture.sample(np.stack([u, v], axis=-1))
    found = renderer.render(scene, (SIZE, SIZE), tl.PathTraced(2), samples=1)
    assert np.abs(found.radiance - expected).max() < 1e-5
    truth, error = tl.reference.path_trace(scene, (SIZE, SIZE), 2)
    assert np.abs(truth.radiance - expected).max() < 1e-12
    assert error.max() < 1e-12


def test_mipmaps_are_means_over_areas(rng: np.random.Generator) -> None:
    texture = tl.Texture(rng.random((5, 3, 3)))
    words = _mipmaps(texture, 0)
    values = np.stack([words & 0xFFFF, words >> 16], axis=-1).reshape(-1, 4) / 65535.0
    np.testing.assert_allclose(values[:15, :3], texture.pixels.reshape(-1, 3), atol=1e-5)
    # Of 5 rows two halves, each over two and a half; the next level begins at a whole word.
    weights = np.array([[1, 1, 0.5, 0, 0], [0, 0, 0.5, 1, 1]]) / 2.5
    halves = np.einsum("kr,rcx->kx", weights, texture.pixels) / 3.0
    np.testing.assert_allclose(values[16:18, :3], halves, atol=1e-5)
    np.testing.assert_allclose(values[18, :3], texture.pixels.mean(axis=(0, 1)), atol=1e-5)
    np.testing.assert_array_equal(words, np.concatenate([words[:8], _mipmaps(texture, 1)]))


def test_the_table_is_that_of_the_scene_that_is_drawn(renderer: tl.Renderer, rng: np.random.Generator) -> None:
    """Not of one with the same meshes; and where objects move it stays."""
    one, other = (tl.Texture(rng.random((2, 2, 3))) for _ in range(2))
    scene = tl.Scene([GRAY, screen(one)], CAMERA, [], BLACK)
    changed = tl.Scene([GRAY, screen(other)], CAMERA, [], BLACK)
    moved = np.eye(4)
    moved[0, 3] = 0.1
    with renderer.gpu.context.current() as gl:
        cache = HierarchyCache(gl)
        first = cache.of(scene, textured=True)
        assert (
            cache.of(replace(scene, objects=(GRAY, replace(scene.objects[1], transform=moved))), textured=True) is first
        )
        assert cache.of(changed, textured=True) is not first
        cache.release()
    pictures = [renderer.render(each, (4, 4), tl.PathTraced(2), samples=1).radiance for each in (scene, changed, scene)]
    assert np.abs(pictures[0] - pictures[1]).max() > 0.01
    np.testing.assert_array_equal(pictures[0], pictures[2])
