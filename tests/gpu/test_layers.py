"""Layers that cover a share of what is behind, vertex colors, holes, glow and occlusion: pixels computed by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh

import translucent as tl
from translucent.geometry.solids import Box

Array = npt.NDArray[np.float64]

SIZE = (9, 9)
MIDDLE = (4, 4)
CORNERS = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float64)
FACES = [[0, 1, 2], [0, 2, 3]]
PLATE = tl.Mesh(CORNERS, FACES, (CORNERS[:, :2] + 1) / 2)
WHITE = tl.Environment.constant((1.0, 1.0, 1.0))
FRONT = tl.Camera.look_at((0, 0, 5), (0, 0, 0), fov_y=30)
BLOCK = Box((-0.8, -0.8, -0.2), (0.8, 0.8, 0.2)).tessellate()
RED, BLUE = np.array([0.8, 0.2, 0.1]), np.array([0.1, 0.2, 0.9])
WINE = tl.Medium((0.5, 1.0, 2.0))
#: What a block of wine leaves of light through its middle.
LEFT = np.exp(-0.4 * np.array([0.5, 1.0, 2.0]))


def at(z: float) -> Array:
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


def layer(opacity: float, color: Any = (1, 1, 1), z: float = 0.0, mesh: tl.Mesh = PLATE, **fields: Any) -> tl.Object:
    """Matt: before white it shows its color."""
    surface = tl.Surface(**{"roughness": 1.0, "ior": 1.0, "color": color, "opacity": opacity} | fields)
    return tl.Object(mesh, tl.Medium(), at(z), sheet_thickness=1e-5, surface=surface)


def render(renderer: tl.Renderer, *objects: tl.Object, samples: int = 1, **scene: Any) -> tl.Frame:
    whole = tl.Scene(objects, scene.pop("camera", FRONT), environment=scene.pop("environment", WHITE), **scene)
    return renderer.render(whole, SIZE, samples=samples)


# Over


@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("opacity", [0.0, 0.25, 1.0])
def test_a_layer_is_painted_over_what_is_behind(renderer: tl.Renderer, opacity: float, samples: int) -> None:
    frame = render(renderer, layer(opacity, RED), samples=samples)
    assert frame.radiance[MIDDLE] == pytest.approx(opacity * RED + (1 - opacity), abs=1e-6)
    assert frame.transmittance[MIDDLE] == pytest.approx([1 - opacity] * 3, abs=1e-6)
    assert np.exp(-frame.optical_depth[MIDDLE]) == pytest.approx([1 - opacity] * 3, abs=1e-6)
    assert frame.coverage[MIDDLE]
    assert frame.valid.all()


def test_the_angle_changes_nothing(renderer: tl.Renderer) -> None:
    slanted = tl.Camera.look_at((0, 4.9, 1), (0, 0, 0), fov_y=10)
    frame = render(renderer, layer(0.25, RED), camera=slanted)
    assert frame.radiance[MIDDLE] == pytest.approx(0.25 * RED + 0.75, abs=1e-6)


@pytest.mark.parametrize("order", [1, -1])
def test_layers_are_painted_far_ones_first(renderer: tl.Renderer, order: int) -> None:
    frame = render(renderer, *[layer(0.25, RED, 0.5), layer(0.5, BLUE, -0.5)][::order])
    assert frame.radiance[MIDDLE] == pytest.approx(0.25 * RED + 0.75 * (0.5 * BLUE + 0.5), abs=1e-6)
    assert frame.transmittance[MIDDLE] == pytest.approx([0.75 * 0.5] * 3, abs=1e-6)


def test_layers_behind_wine_are_seen_through_it(renderer: tl.Renderer) -> None:
    frame = render(renderer, layer(0.25, RED, 1.0), layer(0.5, BLUE, -1.0), tl.Object(BLOCK, WINE))
    behind = LEFT * (0.5 * BLUE + 0.5)
    assert frame.radiance[MIDDLE] == pytest.approx(0.25 * RED + 0.75 * behind, abs=1e-6)
    assert frame.transmittance[MIDDLE] == pytest.approx(LEFT * 0.75 * 0.5, abs=1e-6)


def test_a_layer_before_an_opaque_object_and_one_behind(renderer: tl.Renderer) -> None:
    rock = tl.Object(BLOCK, None, color=(0.5, 0.5, 0.5))
    frame = render(renderer, layer(0.25, RED, 1.0), layer(0.5, BLUE, -1.0), rock)
    assert frame.radiance[MIDDLE] == pytest.approx(0.25 * RED + 0.75 * 0.5, abs=1e-6)
    assert frame.transmittance[MIDDLE] == pytest.approx([0.75] * 3, abs=1e-6)


def test_a_layer_covers_what_glass_mirrors(renderer: tl.Renderer) -> None:
    # No edge lies on a diagonal of the pixels: a ray through the middle of an edge leaves by neither side.
    block = Box((-0.83, -0.77, -0.2), (0.79, 0.81, 0.2)).tessellate()
    glass = tl.Object(block, tl.Medium((0.5, 1.0, 2.0), ior=1.5))
    bare = render(renderer, glass).radiance[MIDDLE]
    frame = render(renderer, layer(1.0, RED, 1.0), glass)
    assert frame.radiance[MIDDLE] == pytest.approx(RED, abs=1e-6)
    frame = render(renderer, layer(0.25, RED, 1.0), glass, samples=2)
    assert frame.radiance[MIDDLE] == pytest.approx(0.25 * RED + 0.75 * bare, abs=2e-3)


def test_a_layer_with_one_side_shows_nothing_from_behind(renderer: tl.Renderer) -> None:
    behind = tl.Camera.look_at((0, 0, -5), (0, 0, 0), fov_y=30)
    frame = render(renderer, layer(0.25, RED, double_sided=False), camera=behind)
    assert frame.transmittance[MIDDLE].tolist() == [1.0, 1.0, 1.0]
    frame = render(renderer, layer(0.25, RED, double_sided=True), camera=behind)
    assert frame.transmittance[MIDDLE] == pytest.approx([0.75] * 3, abs=1e-6)


def test_a_layer_shows_its_coat_and_its_glow(renderer: tl.Renderer) -> None:
    """All that an opaque object would: before black, alpha times its radiance."""
    surface: dict[str, Any] = {"roughness": 0.4, "ior": 1.5, "metallic": 0.5, "color": RED, "emissive": (0.1, 0.2, 0.3)}
    opaque = tl.Object(PLATE, None, surface=tl.Surface(**surface))
    hidden = tl.Object(BLOCK, WINE, at(99.0))
    lamp = tl.PointLight((0.5, 0.5, 3.0), (5.0, 5.0, 5.0))
    black = WHITE.with_background(tl.Environment.constant((0.0, 0.0, 0.0)))
    whole = render(renderer, opaque, hidden, environment=black, lights=[lamp])
    quarter = render(renderer, layer(0.25, **surface), hidden, environment=black, lights=[lamp])
    np.testing.assert_allclose(quarter.radiance, 0.25 * whole.radiance, rtol=1e-5)


@pytest.mark.parametrize("ordered", [False, True])
def test_layers_are_those_of_the_reference(renderer: tl.Renderer, ordered: bool) -> None:
    pixels = np.ones((4, 4, 4), dtype=np.float32)
    pixels[:, :2, 3], pixels[2:, :, :3] = 0.5, (0.25, 0.5, 0.75)
    colors = [[1, 0, 0, 1], [0, 1, 0, 0.25], [0, 0, 1, 1], [1, 1, 1, 0.5]]
    shaded = tl.Mesh(CORNERS, FACES, colors=colors)
    scene = tl.Scene(
        [
            layer(0.75, z=1.0, color_texture=tl.Texture(pixels)),
            layer(0.5, z=0.5, mesh=shaded),
            tl.Object(BLOCK, WINE),
            layer(0.5, RED, -1.0),
            tl.Object(BLOCK, None, at(-2.0)),
        ],
        FRONT,
        environment=WHITE,
    )
    frame = renderer.render(scene, (33, 33), tl.FragmentLists() if ordered else None)
    truth = tl.reference.render(scene, (33, 33))
    assert frame.coverage.tolist() == truth.coverage.tolist()
    np.testing.assert_allclose(frame.transmittance, truth.transmittance, atol=1e-5)
    np.testing.assert_allclose(frame.radiance, truth.radiance, atol=5e-4)  # textures hold 11 bits


def test_the_processors_paint_the_same_layers() -> None:
    scene = tl.Scene([layer(0.25, RED, 1.0), layer(0.5, BLUE, -1.0), tl.Object(BLOCK, WINE)], FRONT, environment=WHITE)
    with tl.Renderer(backend="cpu") as renderer:
        frame = renderer.render(scene, SIZE)
    assert frame.radiance[MIDDLE] == pytest.approx(0.25 * RED + 0.75 * LEFT * (0.5 * BLUE + 0.5), abs=1e-6)
    assert "'mesh': these layers reflect only diffusely" in frame.plan.unmodelled


# Vertex colors, holes, glow, occlusion


def test_vertex_colors_multiply_an_opaque_color(renderer: tl.Renderer) -> None:
    mesh = tl.Mesh(CORNERS, FACES, colors=np.tile([0.5, 0.25, 1.0, 1.0], (4, 1)))
    plate = tl.Object(mesh, None, surface=tl.Surface(roughness=1.0, ior=1.0, color=RED))
    frame = render(renderer, plate, tl.Object(BLOCK, WINE, at(99.0)))
    assert frame.radiance[MIDDLE] == pytest.approx(RED * (0.5, 0.25, 1.0), abs=1e-6)


def test_vertex_colors_tint_what_enters_a_body(renderer: tl.Renderer) -> None:
    mesh = tl.Mesh(BLOCK.vertices, BLOCK.faces, colors=np.tile([0.5, 0.25, 1.0, 1.0], (8, 1)))
    frame = render(renderer, tl.Object(mesh, WINE, surface=tl.Surface()))
    assert frame.radiance[MIDDLE] == pytest.approx(LEFT * (0.5, 0.25, 1.0), abs=1e-6)
    assert frame.transmittance[MIDDLE] == pytest.approx(LEFT, abs=1e-6)  # the medium's alone


@pytest.mark.parametrize("by", ["texture", "vertices"])
def test_a_wall_has_holes(renderer: tl.Renderer, by: str) -> None:
    """Clear on the left of the picture, and whole on the right."""
    pixels = np.ones((1, 2, 4), dtype=np.float32)
    pixels[:, 0, 3] = 0.0
    picture = tl.Texture(pixels, wrap=("clamp", "clamp"))
    colors = np.ones((4, 4))
    colors[[0, 3], 3] = 0.0
    mesh = PLATE if by == "texture" else tl.Mesh(CORNERS, FACES, colors=colors)
    surface = tl.Surface(alpha_cutoff=0.5, color_texture=picture if by == "texture" else None)
    wall = tl.Object(mesh, tl.Medium((100.0, 200.0, 300.0)), sheet_thickness=1e-2, surface=surface)
    frame = render(renderer, wall)
    assert frame.radiance[4, 2].tolist() == frame.transmittance[4, 2].tolist() == [1.0, 1.0, 1.0]
    assert (frame.coverage[4, 2], frame.coverage[4, 6]) == (False, True)
    truth = tl.reference.render(tl.Scene([wall], FRONT, environment=WHITE), SIZE, refraction=False)
    assert frame.transmittance[4, 6] == pytest.approx(truth.transmittance[4, 6], abs=1e-6)
    assert (frame.transmittance[4, 6] < 0.5).all()


@pytest.mark.parametrize("samples", [1, 3])
@pytest.mark.parametrize("sheet", [None, 1e-3])
def test_a_body_adds_its_glow_where_it_is_entered(renderer: tl.Renderer, sheet: float | None, samples: int) -> None:
    glow = np.array([0.3, 0.2, 0.1])
    dark = tl.Object(BLOCK, WINE, sheet_thickness=sheet)
    lamp = tl.Object(BLOCK, WINE, sheet_thickness=sheet, surface=tl.Surface(emissive=glow))
    off, on = render(renderer, dark, samples=samples), render(renderer, lamp, samples=samples)
    assert on.radiance[MIDDLE] == pytest.approx(off.radiance[MIDDLE] + glow, abs=1e-6)
    assert on.radiance[0, 0].tolist() == off.radiance[0, 0].tolist()
    # By NumPy where nothing glows, else by the shader.
    np.testing.assert_allclose(on.transmittance, off.transmittance, rtol=2 * np.finfo(np.float32).eps)
    behind = render(renderer, lamp, layer(0.25, RED, 1.0), samples=samples)
    assert behind.radiance[MIDDLE] == pytest.approx(0.25 * RED + 0.75 * on.radiance[MIDDLE], abs=1e-6)
    hidden = render(renderer, lamp, tl.Object(BLOCK, None, at(1.0), color=(0.5, 0.5, 0.5)), samples=samples)
    assert hidden.radiance[MIDDLE] == pytest.approx([0.5] * 3, abs=1e-6)


def test_a_glow_has_the_pattern_of_its_texture(renderer: tl.Renderer) -> None:
    pixels = np.zeros((1, 2, 3), dtype=np.float32)
    pixels[:, 1] = (0.5, 0.5, 0.5)
    lit = tl.Surface(emissive=(1.0, 0.5, 0.25), emissive_texture=tl.Texture(pixels, wrap=("clamp", "clamp")))
    pane = tl.Object(PLATE, tl.Medium(), sheet_thickness=1e-3, surface=lit)
    row = render(renderer, pane).radiance[4]
    assert row[2].tolist() == [1.0, 1.0, 1.0]
    assert row[6] == pytest.approx([1.5, 1.25, 1.125], abs=1e-6)


def test_occlusion_dims_the_environment_and_no_lights(renderer: tl.Renderer) -> None:
    shade = tl.Texture(np.full((1, 1, 3), 0.25, dtype=np.float32))
    hidden = tl.Object(BLOCK, WINE, at(-99.0))
    sun = tl.DirectionalLight((0, 0, -1), (np.pi, np.pi, np.pi))
    found = {}
    for occlusion in (None, shade):
        surface = tl.Surface(roughness=1.0, ior=1.0, color=RED, occlusion_texture=occlusion)
        plate = tl.Object(PLATE, None, surface=surface)
        found[occlusion] = render(renderer, plate, hidden, lights=[sun]).radiance[MIDDLE]
    assert found[None] == pytest.approx(RED + RED, abs=1e-6)
    assert found[shade] == pytest.approx(0.25 * RED + RED, abs=1e-6)


def test_occlusion_dims_what_glass_mirrors_and_its_paint(renderer: tl.Renderer) -> None:
    shade = tl.Texture(np.full((1, 1, 3), 0.25, dtype=np.float32))
    black = WHITE.with_background(tl.Environment.constant((0.0, 0.0, 0.0)))
    found = []
    for occlusion in (None, shade):
        surface = tl.Surface(transmission=0.0, color=RED, occlusion_texture=occlusion)
        pane = tl.Object(PLATE, tl.Medium(ior=1.5), sheet_thickness=1e-3, surface=surface)
        found.append(render(renderer, pane, environment=black).radiance[MIDDLE])
    np.testing.assert_allclose(found[1], 0.25 * found[0], rtol=1e-5)


# Nothing of it where nothing asks


def test_a_scene_without_any_of_it_has_no_such_pass() -> None:
    scene = tl.Scene([tl.Object(BLOCK, WINE), tl.Object(PLATE, WINE, sheet_thickness=1e-3)], FRONT)
    assert [step.name for step in tl.plan(scene).passes] == ["signed_depth", "thin_layer", "transmittance"]


def test_a_file_is_drawn_as_viewers_do(renderer: tl.Renderer, tmp_path: Path) -> None:
    """A matt red pane of alpha 1/4, unlit so that its color is what is seen."""
    pane = trimesh.Trimesh(CORNERS, FACES, process=False)
    path = tmp_path / "pane.gltf"
    files = trimesh.Scene([pane]).export(file_type="gltf")
    tree = json.loads(files.pop("model.gltf"))
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    tree["materials"] = [
        {
            "alphaMode": "BLEND",
            "pbrMetallicRoughness": {"baseColorFactor": [*RED, 0.25]},
            "extensions": {"KHR_materials_unlit": {}},
        }
    ]
    tree["meshes"][0]["primitives"][0]["material"] = 0
    path.write_text(json.dumps(tree))
    with pytest.warns(tl.TranslucentWarning, match="alphaMode BLEND: partly transparent layers"):
        scene = tl.load_scene(path)
    frame = render(renderer, *scene.objects)
    assert frame.radiance[MIDDLE] == pytest.approx(0.25 * RED + 0.75, abs=1e-6)
