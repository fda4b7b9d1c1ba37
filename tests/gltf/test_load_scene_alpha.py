"""Alpha, colors of vertices, emission and occlusion of glTF materials: layers, holes, and what solids make of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.gltf.gltf_writer import BOX, Json, Writer, glass, load, material_scene
from tests.gltf.test_load_scene_surfaces import base_color, plate, png
from translucent.gltf.objects import BLENDED, WALL_SHARE

pytestmark = pytest.mark.filterwarnings("ignore::translucent.TranslucentWarning")

BLEND: Json = {"alphaMode": "BLEND", "doubleSided": True}
SMOKE: Json = BLEND | {"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 0.25]}}
MASK: Json = {"alphaMode": "MASK", "alphaCutoff": 0.4}
CLEAR_HALF = png(np.array([[[255, 255, 255, 0]] * 4 + [[255, 255, 255, 255]] * 4], dtype=np.uint8))


def colored(tmp_path: Path, colors: Any, material: Json | None = None, **fields: Any) -> Any:
    """A scene of one box with colors at its vertices."""
    writer = Writer()
    box = writer.primitive()
    box["attributes"]["COLOR_0"] = writer.accessor(colors, **fields)
    if material is not None:
        box["material"] = writer.material(name="Stuff", **material)
    writer.add("nodes", mesh=writer.mesh(box), name="Box")
    return load(writer, tmp_path)


def test_a_blended_material_is_a_layer_that_covers_its_alpha(tmp_path: Path) -> None:
    scene = material_scene(tmp_path, {"name": "Smoke", **SMOKE})
    (layer,) = scene.objects
    assert layer.covers
    assert not layer.has_interface
    assert layer.sheet_thickness == pytest.approx(WALL_SHARE * scene.diagonal, rel=1e-14)
    assert (layer.medium, layer.surface.opacity, layer.surface.double_sided) == (tl.Medium(), 0.25, True)
    assert np.asarray(layer.base_color).tolist() == [0.2, 0.4, 0.6]
    assert scene.left_out == (f"{BLENDED} ('Smoke')",)
    # Two faces of a box: each leaves 3/4, at whatever angle.
    truth = tl.reference.render(scene, (9, 9))
    assert truth.transmittance[4, 4] == pytest.approx([0.75**2] * 3, rel=1e-12)


def test_a_blended_material_that_covers_all_is_opaque(tmp_path: Path) -> None:
    (item,) = material_scene(tmp_path, BLEND).objects
    assert (item.medium, item.sheet_thickness, item.surface.opacity) == (None, None, None)
    assert material_scene(tmp_path, BLEND).left_out == ()
    (item,) = tl.load_scene(plate(tmp_path, BLEND | base_color(), png(np.full((2, 2, 4), 255, np.uint8)))).objects
    assert item.medium is None


def test_one_that_covers_nothing_is_hidden(tmp_path: Path) -> None:
    nothing = BLEND | {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}}
    with pytest.raises(tl.InputError, match="the scene of the file has no triangles"):
        material_scene(tmp_path, nothing)


def test_a_layer_has_the_alpha_of_its_texture(tmp_path: Path) -> None:
    scene = tl.load_scene(plate(tmp_path, BLEND | base_color(), CLEAR_HALF))
    assert scene.objects[0].covers
    truth = tl.reference.render(scene, (40, 40))
    row = truth.transmittance[20, :, 0]
    assert (row[11], row[28]) == (1.0, pytest.approx(0.0, abs=1e-30))
    assert not truth.coverage[20, 11]
    assert truth.coverage[20, 28]


def test_masked_walls_have_holes_and_masked_solids_none(tmp_path: Path) -> None:
    wall = MASK | base_color() | {"extensions": glass(1.0, None)}
    scene = tl.load_scene(plate(tmp_path, wall, CLEAR_HALF))
    (item,) = scene.objects
    assert (item.has_holes, item.surface.alpha_cutoff, scene.left_out) == (True, 0.4, ())
    seen = tl.reference.render(scene, (40, 40), refraction=False)
    assert seen.coverage[20, [11, 28]].tolist() == [False, True]
    solid = MASK | base_color() | {"extensions": glass(1.0, 1.0)}
    scene = tl.load_scene(plate(tmp_path, solid, CLEAR_HALF))
    assert scene.objects[0].surface.alpha_cutoff == 0.0
    line = "alphaMode MASK on solids: the holes are drawn closed, because a solid with holes has no inside ('Stuff')"
    assert scene.left_out == (line,)


def test_a_plan_says_that_solids_have_no_holes(tmp_path: Path) -> None:
    mesh = tl.Mesh(BOX.vertices, BOX.faces, colors=np.full((8, 4), 0.25), name="Crate")
    crate = tl.Object(mesh, tl.Medium(1.0), surface=tl.Surface(alpha_cutoff=0.5))
    plan = tl.plan(tl.Scene([crate], tl.Camera.look_at((0, 0, 20), (0, 0, 0))))
    assert (
        "'Crate': holes by alpha_cutoff are drawn closed, because a solid with holes has no inside" in plan.unmodelled
    )


@pytest.mark.parametrize(
    ("values", "fields", "found"),
    [
        (np.full((8, 3), 0.5), {}, [0.5, 0.5, 0.5, 1.0]),
        (np.full((8, 4), 51), {"dtype": "u1", "normalized": True}, [0.2, 0.2, 0.2, 0.2]),
        (np.full((8, 4), 13107), {"dtype": "u2", "normalized": True}, [0.2, 0.2, 0.2, 0.2]),
        (np.full((8, 3), 1.5), {}, None),
    ],
    ids=["three floats", "bytes", "shorts", "white after clamping"],
)
def test_colors_of_vertices_are_linear(tmp_path: Path, values: Any, fields: Json, found: list[float] | None) -> None:
    (item,) = colored(tmp_path, values, {}, **fields).objects
    if found is None:
        assert item.mesh.colors is None
    else:
        np.testing.assert_allclose(item.mesh.colors, np.tile(found, (len(item.mesh.vertices), 1)), rtol=1e-12)


def test_colors_stay_with_their_vertices(tmp_path: Path) -> None:
    """A vertex of two colors stays two, and the mesh closed."""
    colors = np.column_stack([(BOX.vertices + (1, 2, 3)) / (2, 4, 6), np.ones(8)])
    (item,) = colored(tmp_path, colors, {}).objects
    np.testing.assert_allclose(item.mesh.colors[:, :3], (item.mesh.vertices + (1, 2, 3)) / (2, 4, 6), atol=1e-7)
    assert item.mesh.diagnosis.solid


def test_a_mesh_with_colors_and_no_material_is_matt(tmp_path: Path) -> None:
    scene = colored(tmp_path, np.full((8, 3), 0.5))
    surface = scene.objects[0].surface
    assert (surface.ior, surface.metallic, np.asarray(surface.color).tolist()) == (1.0, 0.0, [1.0, 1.0, 1.0])
    assert scene.left_out == ()


def test_colors_tint_what_enters_a_body(tmp_path: Path) -> None:
    (item,) = colored(tmp_path, np.full((8, 3), 0.5), {"extensions": glass(1.0, 1.0, ior=1.0)}).objects
    assert item.has_interface


def test_as_many_colors_as_vertices(tmp_path: Path) -> None:
    with pytest.raises(tl.InputError, match="mesh 'Box' has 7 colors, but 8 vertices"):
        colored(tmp_path, np.full((7, 3), 0.5))
    with pytest.raises(tl.InputError, match="a vertex color is outside 0 to 1"):
        tl.Mesh(BOX.vertices, BOX.faces, colors=np.full((8, 4), 1.5))


def test_a_body_glows_as_its_material_says(tmp_path: Path) -> None:
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 3.0}}
    material = {"emissiveFactor": [0.0, 0.5, 1.0], "extensions": glass(1.0, 1.0) | strong}
    scene = material_scene(tmp_path, material)
    assert np.asarray(scene.objects[0].surface.emissive).tolist() == [0.0, 1.5, 3.0]
    assert scene.left_out == ()
    assert [step.name for step in tl.plan(scene).passes][-1] == "layers"


def test_occlusion_is_read_with_its_strength(tmp_path: Path) -> None:
    picture = png(np.array([[[0, 255, 255], [255, 0, 0]]], dtype=np.uint8))
    path = plate(tmp_path, {"occlusionTexture": {"index": 0, "strength": 0.25}}, picture)
    scene = tl.load_scene(path)
    assert scene.objects[0].surface.occlusion_texture.pixels[0, :, 0].tolist() == [0.75, 1.0]
    assert scene.left_out == ()
    with pytest.raises(tl.InputError, match=r"strength 2 is not in 0\.\.1"):
        tl.load_scene(plate(tmp_path, {"occlusionTexture": {"index": 0, "strength": 2}}, picture))


def test_media_fill_bodies_and_leave_layers(tmp_path: Path) -> None:
    from translucent.scene.showcase import filled

    scene = material_scene(tmp_path, SMOKE)
    rock = tl.Object(scene.objects[0].mesh, None)
    wine = tl.Medium(3.0)
    both = filled(tl.Scene([scene.objects[0], rock], scene.camera), wine)
    assert [item.medium for item in both.objects] == [tl.Medium(), wine]
    (alone,) = filled(scene, wine).objects
    assert (alone.medium, alone.covers) == (wine, False)


def test_only_thin_sheets_cover() -> None:
    mesh = tl.Mesh(BOX.vertices, BOX.faces, name="Crate")
    with pytest.raises(
        tl.InputError, match="opacity of 'Crate'; the object is opaque, and only thin-walled sheets can have an opacity"
    ):
        tl.Object(mesh, None, surface=tl.Surface(opacity=0.5))
    with pytest.raises(tl.InputError, match="opacity of 'Crate'; the object is a solid"):
        tl.Object(mesh, tl.Medium(), surface=tl.Surface(opacity=0.5))
    with pytest.raises(tl.InputError, match="surface opacity 2"):
        tl.Surface(opacity=2)
