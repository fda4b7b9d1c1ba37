"""Frames without the environment behind: associated color and alpha, put before anything."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.geometry.solids import Box, Sphere

SIZE = (96, 72)
BALL = Sphere().tessellate(64)
CAMERA = tl.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=40)
GRAY = tl.Medium(absorption=0.4, ior=1.5)


@pytest.fixture
def scene() -> tl.Scene:
    wall = tl.Object(Box((-2, -2, -2), (0, 0, -1.5)).tessellate())
    return tl.Scene([tl.Object(BALL, GRAY), wall], CAMERA, environment=tl.Environment.gradient((0.1,) * 3, (0.9,) * 3))


def test_before_any_gray_it_is_the_frame_with_that_background(renderer: tl.Renderer, scene: tl.Scene) -> None:
    """Radiance = alone + (1 - alpha) behind, as nothing tints."""
    alone = renderer.render(scene, SIZE, samples=4, transparent=True)
    assert alone.alpha is not None
    behind = scene.environment.with_background(tl.Environment.constant((0.5,) * 3))
    expected = renderer.render(dataclasses.replace(scene, environment=behind), SIZE, samples=4, adaptive=False)
    over = alone.radiance + (1 - alone.alpha[..., None]) * 0.5
    np.testing.assert_allclose(over, expected.radiance, atol=1e-5)
    assert alone.alpha[0, 0] == 0
    assert (alone.radiance[0, 0] == 0).all()
    assert alone.alpha.max() == 1  # the wall
    assert ((alone.alpha > 0.1) & (alone.alpha < 0.9)).any()  # the ball


def test_files_hold_alpha(renderer: tl.Renderer, scene: tl.Scene, tmp_path: Path) -> None:
    OpenEXR = pytest.importorskip("OpenEXR")
    frame = renderer.render(scene, SIZE, transparent=True)
    for name in ("a.png", "a.exr", "a.npz"):
        frame.save(tmp_path / name)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.mode == "RGBA"
        pixels = np.asarray(picture)
    assert pixels[0, 0, 3] == 0
    np.testing.assert_array_equal(np.load(tmp_path / "a.npz")["alpha"], frame.alpha)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        np.testing.assert_array_equal(file.channels()["RGBA"].pixels[..., 3], frame.alpha)


def test_a_backdrop_is_refused(renderer: tl.Renderer) -> None:
    body = tl.Scene([tl.Object(BALL, GRAY)], CAMERA)
    backdrop = tl.Backdrop(np.zeros((72, 96, 3)), np.full((72, 96), np.inf))
    with pytest.raises(tl.InputError, match="a transparent frame; the frame also has a backdrop"):
        renderer.render(body, SIZE, backdrop=backdrop, transparent=True)
