"""Scenes of several models: names with materials, .toml files, and the toolkit's own scenes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.assets import scene_names
from translucent.commands.model import NamedMedium, SceneRequest, read_scene
from translucent.commands.options import FileOptions
from translucent.preview.document import AUTO, Document, Look, Model
from translucent.preview.exports import Recipe, command_line, python_code
from translucent.preview.scenes import first_orbit, load, scene_of, stage_name
from translucent.scene.touching import with_priorities

pytestmark = pytest.mark.usefixtures("few_shadows", "one_renderer")

TEXT = "goblet:crystal wine:#7b1e3a@1cm"


def test_models_with_materials_are_one_scene() -> None:
    scene = tl.load_scene(TEXT)
    glass, wine, ground = scene.objects
    assert ground.shadow_catcher
    assert scene.overlap == "priority"
    assert glass.priority > wine.priority  # a drink gives way to its glass
    assert glass.medium == tl.preset("crystal").medium
    np.testing.assert_allclose(wine.medium.absorption, tl.Medium.from_color("#7b1e3a", 0.01).absorption)


def test_command_line_python_and_window_have_one_scene() -> None:
    size = (64, 48)
    python = tl.load_scene(TEXT, size=size)
    command = read_scene(TEXT, SceneRequest(size=size, stage=None))
    window = load(Model(TEXT)).scene
    for one in (command, window):
        for mine, theirs in zip(python.objects, one.objects, strict=False):
            assert (mine.medium, mine.priority) == (theirs.medium, theirs.priority)
            np.testing.assert_array_equal(mine.mesh.vertices, theirs.mesh.vertices)
    np.testing.assert_allclose(command.camera.pose, python.camera.pose)
    assert len(command.lights) == len(python.lights) == 1


def test_options_fill_what_has_no_material() -> None:
    scene = read_scene("goblet wine:merlot", SceneRequest(medium=tl.preset("jade").medium, roughness=0.2, stage="none"))
    glass, wine = scene.objects
    assert (glass.medium, wine.medium) == (tl.preset("jade").medium, tl.preset("merlot").medium)
    assert glass.surface.roughness == 0.2
    assert wine.surface is None


def test_a_mesh_of_the_toolkit_is_named_as_on_the_command_line() -> None:
    media = [NamedMedium("goblet", tl.preset("crystal").medium, None)]
    scene = read_scene("goblet wine:merlot", SceneRequest(media=media, stage="none"))
    assert [item.medium for item in scene.objects] == [tl.preset("crystal").medium, tl.preset("merlot").medium]


def test_a_height_scales_the_whole() -> None:
    scene = read_scene(TEXT, SceneRequest(stage="none", file=FileOptions(height="10cm")))
    glass, wine = scene.objects
    assert np.ptp(scene.bounds[:, 1]) == pytest.approx(0.1)
    before = tl.load_scene(TEXT)
    factor = 0.1 / np.ptp(before.objects[0].bounds[:, 1])
    np.testing.assert_allclose(wine.bounds, factor * before.objects[1].bounds, atol=1e-9)
    assert glass.medium == before.objects[0].medium


@pytest.mark.parametrize("name", scene_names())
def test_own_scenes_are_sound(name: str) -> None:
    scene = tl.load_scene(name)
    assert all(body.mesh.diagnosis.solid for body in scene.bodies)
    plan = tl.plan(scene)
    assert not [note for note in plan.remarks if "black" in str(note)]


def test_ice_displaces_the_drink_and_not_the_glass() -> None:
    priority = {item.mesh.name: item.priority for item in tl.load_scene("ice-in-a-drink").objects}
    assert priority["drink.ply"] < min(priority["ice 1"], priority["ice 2"], priority["tumbler.ply"])


def test_stated_priorities_stay() -> None:
    box, medium = tl.load_scene(TEXT).objects[0].mesh, tl.Medium(1.0)
    stated = [tl.Object(box, medium, priority=3), tl.Object(box, tl.Medium(2.0))]
    scene = tl.Scene(stated, tl.Camera.look_at((0, 0, 1), (0, 0, 0)))
    assert with_priorities(scene) == (scene, ())


def write(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def test_a_file_says_where_how_large_and_what(tmp_path: Path) -> None:
    text = """
    environment = "studio,90"
    stage = "none"
    [[object]]
    model = "sphere"
    name = "pearl"
    scattering_color = "#f2e0b8"
    mean_free_path = "2mm"
    height = "10mm"
    translate = [0, "2cm", 0.5]
    rotate = [0, 90, 0]
    surface = { clearcoat = 1.0, roughness = 0.3 }
    [[object]]
    model = "soap"
    opaque = "#804020"
    scale = [1, 2, 1]
    [camera]
    eye = [0, "10cm", 1]
    fov = 40
    [[light]]
    type = "point"
    position = [0, 1, 0]
    intensity = [1, 2, 3]
    """
    scene = tl.load_scene(write(tmp_path, text))
    pearl, soap = scene.objects
    assert pearl.mesh.name == "pearl"
    assert np.ptp(pearl.bounds[:, 1]) == pytest.approx(0.01)
    np.testing.assert_allclose(pearl.matrix[:3, 3], (0, 0.02, 0.5))
    np.testing.assert_allclose(pearl.matrix[:3, 0], (0, 0, -1), atol=1e-12)  # counterclockwise as seen from above
    assert (pearl.surface.clearcoat, pearl.surface.roughness, pearl.medium.ior) == (1.0, 0.3, 1.4)
    assert soap.medium is None
    np.testing.assert_allclose(scene.camera.eye, (0, 0.1, 1))
    assert scene.camera.fov_y == 40
    np.testing.assert_allclose(scene.lights[0].intensity, (1, 2, 3))


OBJECT = '[[object]]\nmodel = "sphere"\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[object]]\nmodel = 3\n", "line 2, model; the model is missing"),
        (
            '[[object]]\nmodel = "sfere"\n',
            "line 2, model; model 'sfere'; no file and no built-in mesh has this name; did you",
        ),
        (OBJECT + 'preset = "waxx"\n', "line 3, preset; preset 'waxx'; no preset has this name; did you mean wax"),
        (OBJECT + OBJECT + 'colour = "red"\n', "line 5, colour; unknown key 'colour'; did you mean color?"),
        (OBJECT + 'color = "red"\n', "line 3, color; distance is missing; give both"),
        (OBJECT + 'color = "red"\ndistance = "2cm"\npreset = "wax"\n', "line 3, color; preset is given, too"),
        (OBJECT + 'color = "rde"\ndistance = "2cm"\n', "line 3, color; color 'rde'"),
        (OBJECT + 'color = "#aa5555"\ndistance = "2 cx"\n', "line 4, distance; "),
        (OBJECT + "translate = [1, 2]\n", "line 3, translate; [1, 2]; write translate = [0, 0.1, 0]"),
        (OBJECT + "surface = { roughnes = 1 }\n", "line 3, roughnes; unknown key 'roughnes'; did you mean roughness"),
        (
            OBJECT + "[[light]]\ntype = 'lamp'\n",
            "line 4, type; unknown type 'lamp'; use one of directional, point, sphere",
        ),
        (OBJECT + "[[light]]\ntype = 'point'\nposition = [0, 0, 0]\n", "line 4, type; a point light; "),
        ("stage = 'nigth'\n" + OBJECT, "line 1, stage; stage 'nigth'; no stage has this name; did you mean night?"),
        (OBJECT + "[camera]\neye = [0, 0, 1]\nfit = 1\n", "line 5, fit; fit; the key eye is given, too"),
        ("objects = 1\n", "line 1, objects; unknown key 'objects'; did you mean object?"),
        ("[[object]\n", "the file is not valid TOML: "),
        (
            "version = 1\n",
            "the file is a session of the previewer; open the session with: translucent preview --session",
        ),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(tl.InputError) as caught:
        tl.load_scene(write(tmp_path, text))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("models", "message"),
    [
        (
            ("goblett:crystal", "wine"),
            "model 'goblett:crystal'; no file 'goblett' and no built-in mesh has this name; did you",
        ),
        (("goblet:cristal", "wine"), "preset 'cristal'; no preset has this name; did you mean crystal"),
        (
            ("goblet", "glass-of-milk"),
            "the word names a whole scene, which cannot be combined with other models; render the scene alone:",
        ),
        (("glass-of-mlik.toml",), "scene 'glass-of-mlik.toml'"),
    ],
)
def test_slips_on_the_command_line(run: Run, tmp_path: Path, models: Any, message: str) -> None:
    assert message in one_error_line(run("render", *models, "-o", tmp_path / "a.png"))


def test_several_models_are_drawn(run: Run, tmp_path: Path) -> None:
    options = ("-o", tmp_path / "a.npz", "--size", "24x18", "--samples", "1", "--stage", "none")
    result = run("render", "sphere:crystal", "soap:whisky", *options)
    assert result.code == 0
    assert "where bodies overlap, sphere displaces soap" in result.err
    assert len(result.out.splitlines()) <= 6
    explained = run("explain", "sphere:crystal", "soap:whisky")
    assert "2 objects, 2 of them translucent" in explained.out


def test_the_window_keeps_stage_and_recipe() -> None:
    loaded = load(Model(TEXT))
    document = Document(Model(TEXT), look=Look(stage=AUTO), orbit=first_orbit(loaded, (64, 48), "studio"))
    assert stage_name(document.look, loaded) == "studio"
    assert stage_name(document.look, load(Model("lamp-in-wax"))) == "night"
    recipe = Recipe(document, loaded, scene_of(document, loaded), (64, 48))
    words, _ = command_line(recipe)
    assert words.startswith(f"translucent render '{TEXT}' -o ")
    code = python_code(recipe)
    assert f"load_composed({TEXT!r})" in code
    space: dict[str, Any] = {}
    exec(code.partition("with tl.Renderer()")[0], space)
    assert [item.mesh.name for item in space["scene"].objects] == ["goblet.ply", "wine.ply", "ground"]
