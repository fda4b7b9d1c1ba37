"""Looks of third-party glTF files: by what has to hold of the pictures, whatever the light."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import translucent as tl
from translucent.formulas.color import luminance
from translucent.scene.showcase import framing

pytestmark = pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")

Array = npt.NDArray[np.float64]


def loaded(assets: Path, name: str) -> tl.Scene:
    scene: tl.Scene = tl.load_scene(assets / "gltf" / f"{name}.glb")
    return scene


def seen(
    renderer: tl.Renderer, scene: tl.Scene, camera: tl.Camera, size: tuple[int, int], samples: int = 1
) -> tl.Frame:
    frame = renderer.render(dataclasses.replace(scene, camera=camera), size, samples=samples)
    assert np.isfinite(frame.radiance).all()
    assert frame.radiance.min() >= 0
    return frame


@pytest.mark.parametrize("environment", ["studio", "white", "dark"])
def test_the_attenuation_test_has_one_shade_in_every_column(
    renderer: tl.Renderer, assets: Path, environment: str
) -> None:
    """Thin walls, modelled thickness, one mesh, scaled nodes, attenuation distances: alike to 2/255 when shown.

    Within a column all five have the same interfaces, and so the same reflections. Thickness is that of the meshes,
    so that the 8 bits of the file's thickness texture do not matter.
    """
    scene = loaded(assets, "AttenuationTest")
    if environment == "white":
        scene = dataclasses.replace(scene, environment=tl.Environment.constant((1, 1, 1)))
    elif environment == "dark":
        behind = tl.Environment.constant((0, 0, 0)).with_background(tl.Environment.constant((0.8, 0.8, 0.8)))
        scene = dataclasses.replace(scene, environment=behind, objects=scene.bodies)
    reds = []
    for x in (-3.5, -2.0, 0.0, 2.5, 6.0):
        column = []
        for y in (6.0, 3.0, 0.0, -3.0, -6.0):
            position = (x + 0.06, y + 0.06)  # off the lines of the grid behind
            camera = tl.Camera.orthographic((*position, 9.0), (*position, 0.0), height=0.02)
            column.append(seen(renderer, scene, camera, (4, 4)).to_srgb8()[1, 1].astype(int))
        assert np.ptp(column, axis=0).max() <= 2, (x, column)
        reds.append(column[0][0])
    assert (np.diff(reds) < -5).all()  # and each is deeper than the one before


def test_the_transmission_test_blurs_more_with_roughness_and_with_the_index(
    renderer: tl.Renderer, assets: Path
) -> None:
    scene = loaded(assets, "TransmissionRoughnessTest")
    camera = tl.Camera.orthographic((0.2, 0, 2.0), (0.2, 0, 0.0), height=0.8)
    shown = luminance(seen(renderer, scene, camera, (240, 160), samples=2).radiance)  # 200 pixels in a metre
    contrast = {}
    for ior, y in {1.0: -0.22, 1.33: -0.11, 1.5: 0.0, 2.42: 0.22}.items():
        for x, column in ((-0.22, 0), (0.2, 4), (0.62, 8)):
            row, start = round(80 - 200 * y), round(120 + 200 * (x - 0.2))
            tile = shown[row - 5 : row + 5, start - 5 : start + 5]
            contrast[ior, column] = float(np.std(tile) / np.mean(tile))
    print(contrast)
    for ior in (1.33, 1.5, 2.42):
        assert contrast[ior, 8] < 0.1 < contrast[ior, 0], contrast
        assert contrast[ior, 8] < contrast[ior, 4] < contrast[ior, 0], contrast
    assert contrast[1.0, 8] == pytest.approx(contrast[1.0, 0], rel=0.5)  # without an interface nothing is blurred


def test_the_candle_holder_is_of_blue_glass_on_polished_metal(renderer: tl.Renderer, assets: Path) -> None:
    scene = loaded(assets, "GlassHurricaneCandleHolder")
    camera = framing(scene.objects, (96, 128))
    frame = seen(renderer, scene, camera, (96, 128))
    glass = frame.coverage & frame.valid
    assert 0.15 < glass.mean() < 0.6
    red, _, blue = frame.radiance[glass].mean(axis=0)
    assert red < 0.9 * blue
    foot = frame.radiance[100:122, 38:58]
    assert np.ptp(luminance(foot)) > 0.5  # mirror images of lamps and cards


def test_the_heads_are_lacquered_of_metal_and_of_glass(renderer: tl.Renderer, assets: Path) -> None:
    stripes = np.tile(np.kron([0.1, 1.0], np.ones(8))[None, :, None], (64, 8, 3))
    lights = tl.Environment.image(stripes.astype(np.float32))
    scene = dataclasses.replace(loaded(assets, "IridescenceSuzanne"), environment=lights, lights=())
    spread = []
    for x in (-3.0, 0.0, 3.0):
        camera = tl.Camera.orthographic((x, 0, 6), (x, 0, 0), height=0.7)
        shown = luminance(seen(renderer, scene, camera, (48, 48)).radiance)
        spread.append(float(np.std(shown) / np.mean(shown)))
    # Paint is even in such light, but for what its coat mirrors (11 % face-on); metal and glass show the stripes.
    assert spread[0] < 0.6 * spread[1], spread
    assert spread[0] < 0.6 * spread[2], spread


def test_normal_maps_of_bodies_lean_like_those_of_opaque_objects(renderer: tl.Renderer) -> None:
    """A pane whose normals lean mirrors what a pane turned that way mirrors."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float64)
    pane = tl.Mesh(corners, [[0, 1, 2], [0, 2, 3]], (corners[:, :2] + 1) / 2)
    sky = tl.Environment.gradient((0, 0, 0), (1, 1, 1))
    camera = tl.Camera.orthographic((0, 0, 5), (0, 0, 0), height=0.5)
    lean = np.radians(10)
    for turn in (1.0, -1.0):
        texture = tl.Texture(np.full((2, 2, 3), 0.5 + 0.5 * np.array([0, turn * np.sin(lean), np.cos(lean)])))
        mapped = tl.Object(pane, tl.Medium(ior=1.5), sheet_thickness=1e-4, surface=tl.Surface(normal_texture=texture))
        c, s = np.cos(turn * lean), np.sin(turn * lean)
        tilted = np.array([[1, 0, 0, 0], [0, c, s, 0], [0, -s, c, 0], [0, 0, 0, 1]])
        turned = tl.Object(pane, tl.Medium(ior=1.5), tilted, sheet_thickness=1e-4)
        shades = [
            float(renderer.render(tl.Scene([body], camera, environment=sky), (8, 8)).radiance[4, 4, 0])
            for body in (mapped, turned)
        ]
        straight = 0.5  # what is seen through either: the horizon
        assert (shades[0] - straight) * turn > 1e-3
        assert shades[0] == pytest.approx(shades[1], abs=2e-4)
