"""Tools of an artist: places, lights, snapshots, time, textures, scattering by color and radius, and the lens."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.gltf.test_load_scene_poses import animated
from tests.preview.test_library import two_bodies
from tests.preview.waiting import SIZE, finish, pixels, wait
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Sphere
from translucent.preview.actions import (
    History,
    Keep,
    Place,
    Recall,
    SetField,
    SetLights,
    SetTime,
    Stand,
    apply,
    scattered_material,
    scattering_of,
)
from translucent.preview.document import AddedLight, Document, Export, Look, Material, Model, Orbit, Placed, lens_of
from translucent.preview.exports import Recipe, command_line, python_code, write_picture
from translucent.preview.scenes import Loaded, degrees_of, load, material_of, rotation_matrix, scene_of
from translucent.preview.session import from_table, load_session, save_session, to_table
from translucent.preview.viewport_renderer import ViewportRenderer
from translucent.preview.workspace import Workspace
from translucent.scene.camera import Lens

SEEN = dataclasses.replace(Document(), orbit=Orbit())
PLACE = Placed(1, (0.1, -0.2, 0.3), (20.0, -50.0, 110.0), (1.0, 2.0, 0.5))
LIGHT = AddedLight((0.3, 0.4, 0.5), 0.05, 2.0, (1.0, 0.5, 0.25))


def test_places_lights_and_snapshots_are_steps_of_undo_and_kept_in_sessions(tmp_path: Path) -> None:
    steps = [
        Place(Placed(1, (0.5, 0.0, 0.0)), 1),
        Place(PLACE, 1),  # the same drag
        SetLights((LIGHT,)),
        SetField("export.width", 640.0),
        Keep("1"),
        SetField("look.depth_of_field", value=True),
        SetTime(0.5),
        Recall("1"),
    ]
    history = History(SEEN)
    for step in steps:
        history = history.done(step)
    assert len(history.past) == len(steps) - 1
    document = history.present
    assert document.placed == (PLACE,)
    assert not document.look.depth_of_field, "as it was when the snapshot was kept"
    assert document.model.time == 0.5, "a snapshot has no time"
    save_session(tmp_path / "a.toml", document)
    assert load_session(tmp_path / "a.toml") == document
    assert apply(document, Place(Placed(1))).placed == ()
    with pytest.raises(tl.InputError, match=r"snapshot '7'.*use one of: 1"):
        apply(document, Recall("7"))
    for key, value, message in (
        ("lights", [{"radius": -1.0}], "the value is outside its range"),
        ("placed", [{"object": "a"}], "the number of an object"),
        ("snapshots", [{"name": ""}], "give each snapshot a name"),
    ):
        with pytest.raises(tl.InputError, match=message):
            from_table({**to_table(SEEN), key: value}, "session")


def test_an_object_is_scaled_then_rotated_about_its_middle_then_moved() -> None:
    """Others stay the same objects, and angles are read back from the rotation."""
    loaded = two_bodies()
    before, after = (scene_of(one, loaded) for one in (SEEN, apply(SEEN, Place(PLACE))))
    assert [after.objects[i] is before.objects[i] for i in range(3)] == [True, False, True]
    item, moved = before.objects[1], after.objects[1]
    middle = item.bounds.mean(axis=0)
    corner = item.mesh.vertices @ item.matrix[:3, :3].T + item.matrix[:3, 3] - middle
    turn = rotation_matrix(PLACE.rotation)
    np.testing.assert_allclose(degrees_of(turn), PLACE.rotation)
    expected = (corner * PLACE.scale) @ turn.T + middle + PLACE.location
    found = moved.mesh.vertices @ moved.matrix[:3, :3].T + moved.matrix[:3, 3]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_recipes_have_places_and_lights_or_say_that_they_lack_them() -> None:
    loaded = dataclasses.replace(two_bodies(), model=Model("a.glb"))
    document = apply(apply(SEEN, Place(PLACE)), SetLights((LIGHT, AddedLight((1.0, 0.0, 0.0)))))
    recipe = Recipe(document, loaded, scene_of(document, loaded), SIZE)
    assert {"places of objects", "added lights"} <= set(command_line(recipe)[1])
    code = python_code(recipe)
    compile(code, "recipe", "exec")
    assert "tl.SphereLight((0.3, 0.4, 0.5), (2, 1, 0.5), 0.05)" in code
    assert "tl.PointLight((1, 0, 0), (1, 1, 1))" in code
    assert "place @ moved.matrix" in code
    lights = recipe.scene.lights[-2:]
    assert [type(light) for light in lights] == [tl.SphereLight, tl.PointLight]


def test_what_was_upwards_in_z_is_upwards_in_y(tmp_path: Path) -> None:
    mesh = Box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0)).tessellate()
    path = tmp_path / "box.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces]
    path.write_text("\n".join(lines))
    found = load(Model(str(path), up="z")).scene
    np.testing.assert_allclose(found.bounds, [[0, 0, -2], [1, 3, 0]], atol=1e-12)
    assert apply(SEEN, Stand("z")).orbit is None, "it is framed anew"


def test_a_color_and_a_radius_give_the_medium_of_the_command_line() -> None:
    """And are read back from it; one of them alone keeps the other, and the proportions of the channels."""
    made = scattered_material(Material(), (0.8, 0.6, 0.4), 0.002)
    expected = tl.scattering_medium((0.8, 0.6, 0.4), 0.002)
    np.testing.assert_allclose(made.scattering, expected.scattering)
    np.testing.assert_allclose(made.absorption, expected.absorption)
    known = scattering_of(made)
    assert known is not None
    np.testing.assert_allclose(known[0], (0.8, 0.6, 0.4))
    wax = dataclasses.replace(made, absorption=(1.0, 2.0, 4.0), scattering=(100.0, 200.0, 300.0))
    wider = scattered_material(wax, radius=2.0 * scattering_of(wax)[1])  # type: ignore[index]
    np.testing.assert_allclose(wider.scattering, np.asarray(wax.scattering) / 2)
    np.testing.assert_allclose(wider.absorption, np.asarray(wax.absorption) / 2)
    assert scattering_of(Material()) is None


def test_pictures_are_put_into_slots_of_meshes_with_texture_coordinates(tmp_path: Path) -> None:
    Image.fromarray(np.array([[[255, 0, 0], [0, 128, 255]]], dtype=np.uint8)).save(tmp_path / "a.png")
    ball = Sphere(radius=0.02).tessellate(8)
    textured = Mesh(ball.vertices, ball.faces, uv=ball.vertices[:, :2])
    material = dataclasses.replace(
        Material(source="color"), color_texture=str(tmp_path / "a.png"), roughness_texture=str(tmp_path / "a.png")
    )
    for mesh in (textured, ball):
        scene = tl.showcase(mesh, stage="none")
        loaded, document = Loaded(Model(), scene, material_of(scene)), dataclasses.replace(SEEN, material=material)
        if mesh is ball:
            with pytest.raises(tl.InputError, match="no texture coordinates"):
                scene_of(document, loaded)
            continue
        surface = scene_of(document, loaded).objects[0].surface
        assert surface is not None
        assert surface.color_texture is not None
        assert surface.roughness_texture is not None
        np.testing.assert_allclose(surface.color_texture.pixels[0, 1], [0.0, 0.2158605, 1.0], atol=1e-6)
        np.testing.assert_allclose(surface.roughness_texture.pixels[0, 1], [0.0, 128 / 255, 1.0], atol=1e-6)


@pytest.mark.filterwarnings("ignore:.*left out. animations")
def test_time_moves_what_the_file_animates_and_undo_goes_back(tmp_path: Path) -> None:
    path = animated("translation", [0, 1], [[0, 0, 0], [3, 0, 0]]).save(tmp_path / "a.glb")
    work = Workspace(Document(Model(str(path))))
    try:
        wait(work, lambda: work.scene() is not None)
        assert work.loaded is not None
        assert work.loaded.scene.duration == 1.0  # type: ignore[attr-defined]
        orbit = work.document.orbit
        for time, x in ((0.5, 1.5), (None, 0.0)):
            work.do(SetTime(time))
            wait(work, lambda: work.loaded is not None and work.loaded.model.time == work.document.model.time)
            scene = work.scene()
            assert scene is not None
            assert scene.objects[0].matrix[0, 3] == pytest.approx(x)
        work.undo()
        assert work.document.model.time == 0.5
        assert work.document.orbit == orbit
    finally:
        work.close()


def test_a_snapshot_is_right_of_the_split(work: Workspace, quick_pictures: None) -> None:
    """The left half is what is on show, the right one what was kept."""
    view = ViewportRenderer()
    try:
        finish(view, work)
        before = pixels(view)
        work.do(Keep("1"))
        work.do(SetField("material.color", (0.9, 0.1, 0.1)))
        finish(view, work)
        after = pixels(view)
        work.do(SetField("display.snapshot", "1"))
        work.do(SetField("display.compare", "snapshot"))
        finish(view, work)
        both, half = pixels(view), view.viewport.size[0] // 2
        assert np.abs(both[:, :half] - after[:, :half]).mean() < 0.1
        assert np.abs(both[:, half:] - before[:, half:]).mean() < 0.1
        assert np.abs(before - after).mean() > 1.0
    finally:
        view.close()


def test_a_lens_keeps_its_plane_sharp() -> None:
    """A point in the plane is at the same pixel from all of the aperture, one behind it moves by similar triangles."""
    camera, size = tl.Camera.look_at((0, 0, 2), (0, 0, 0), fov_y=40.0), (64, 48)
    lens = Lens(0.1, 2.0)
    for depth, spread in ((2.0, 0.0), (4.0, 0.1 * abs(1 / 2.0 - 1 / 4.0))):
        places = []
        for number in range(64):
            moved = lens.camera(camera, size, number, 64)
            origins, directions = moved.rays(size)
            plane = origins + directions * ((2.0 - depth) - origins[..., 2:]) / directions[..., 2:]
            places.append(plane[24, 32, :2])
        extent = np.ptp(np.asarray(places), axis=0)
        np.testing.assert_allclose(extent / depth, spread, rtol=0.12, atol=1e-9)
    with pytest.raises(tl.InputError, match="lens focus"):
        Lens(0.1, 0.0)


def test_an_exported_picture_is_out_of_focus_where_the_viewport_is(work: Workspace, tmp_path: Path) -> None:
    """Both are means over the same lens; a sharp one is further from them than they are from each other."""
    scene, orbit = work.scene(), work.document.orbit
    assert scene is not None
    assert orbit is not None
    look = dataclasses.replace(work.document.look, depth_of_field=True, aperture=0.05, focus=0.5 * orbit.distance)
    assert lens_of(Look(), orbit) is None
    write_picture(str(tmp_path / "sharp.png"), scene, SIZE)
    write_picture(str(tmp_path / "soft.png"), scene, SIZE, samples=16, lens=lens_of(look, orbit))
    sharp, soft = (np.asarray(Image.open(tmp_path / f"{name}.png").convert("RGB"), float) for name in ("sharp", "soft"))
    for name in ("depth_of_field", "aperture", "focus"):
        work.do(SetField(f"look.{name}", getattr(look, name)))
    view = ViewportRenderer()
    try:
        finish(view, work)
        seen = pixels(view)
    finally:
        view.close()
    assert np.abs(seen - sharp).mean() > 1.0
    assert np.abs(seen - soft).mean() < 0.3 * np.abs(sharp - soft).mean()


def test_the_size_of_exports_follows_the_shape_of_the_viewport() -> None:
    assert Export().size((640, 480)) == (640, 480)
    assert Export(width=320.0).size((640, 480)) == (320, 240)
    assert Export(height=96.0).size((640, 480)) == (128, 96)
    assert Export(10.0, 20.0).size((640, 480)) == (10, 20)
