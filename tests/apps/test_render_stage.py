"""``translucent render`` and ``explain`` with stages."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.commands.model import SceneRequest, read_scene
from translucent.commands.options import CameraOptions
from translucent.scene.showcase import LIGHT_TABLE

pytestmark = pytest.mark.usefixtures("one_renderer")

SMALL = ("--size", "48x27", "--samples", "1")
FEW = ("--environment-shadows", "8", "--shadow-size", "64", *SMALL)


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture).astype(int)


def write_gltf(path: Path, **more: object) -> Path:
    """A triangle as glTF."""
    import base64

    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(points).decode()
    accessor = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": uri, "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [accessor],
        "materials": [{"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "nodes": [{"mesh": 0}],
        "extensionsUsed": ["KHR_materials_transmission"],
        **more,
    }
    path.write_text(json.dumps(tree))
    return path


def test_models_stand_on_a_stage_and_cast_shadows(run: Run, tmp_path: Path) -> None:
    staged, none = tmp_path / "staged.png", tmp_path / "none.png"
    code, out, _ = run("render", "bear", "-o", str(staged), "--verbose", *FEW)
    assert code == 0
    assert "shadow_maps" in out
    code, out, _ = run("render", "bear", "-o", str(none), "--stage", "none", "--verbose", *SMALL)
    assert code == 0
    assert "shadow_maps" not in out
    assert np.abs(pixels(staged) - pixels(none)).max() > 30
    code, out, _ = run("explain", "bear")
    assert code == 0
    assert "1 opaque object" in out
    assert "bear.ply: 11260 vertices" in out


@pytest.mark.parametrize("option", [("--environment", "studio"), ("--background", "white")])
def test_environments_take_the_place_of_the_stage(run: Run, tmp_path: Path, option: tuple[str, str]) -> None:
    code, out, _ = run("render", "sphere", "-o", str(tmp_path / "a.png"), *option, "--verbose", *SMALL)
    assert code == 0
    assert "shadow_maps" not in out
    code, out, _ = run("render", "sphere", "-o", str(tmp_path / "a.png"), *option, "--stage", "daylight", "-v", *FEW)
    assert code == 0
    assert " 8 directions of the environment" in out


def test_stages_have_128_shadows(run: Run) -> None:
    assert " 128 directions of the environment" in run("explain", "sphere", "--stage", "daylight").out


def test_transparent_pictures_keep_the_shadow(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    medium = ("--color", "#7b1e3a", "--distance", "1cm")
    assert run("render", "sphere", "-o", str(path), *medium, "--transparent", *FEW)[0] == 0
    arrays = np.load(path)
    beside = ~arrays["coverage"]
    assert (arrays["alpha"][beside] > 0.1).any(), "the shadow"
    assert (arrays["alpha"][beside] < 1e-4).sum() > 0.2 * beside.sum(), "no ground"
    assert (arrays["radiance"][beside] == 0).all()


def test_turntables_have_a_stage(run: Run, tmp_path: Path) -> None:
    options = ("--turntable", "2", "--stage", "night", *FEW)
    assert run("render", "sphere", "-o", str(tmp_path / "a.gif"), *options)[0] == 0


def test_files_with_cameras_lights_or_grounds_keep_to_them(tmp_path: Path) -> None:
    bare = write_gltf(tmp_path / "bare.gltf")
    assert len(read_scene(str(bare), SceneRequest(stage=None)).objects) == 2
    assert len(read_scene(str(bare), SceneRequest()).objects) == 1
    camera = {"cameras": [{"type": "perspective", "perspective": {"yfov": 0.6, "znear": 0.1}}]}
    seen = write_gltf(tmp_path / "seen.gltf", **camera, nodes=[{"mesh": 0}, {"camera": 0, "translation": [0, 0, 5]}])
    scene = read_scene(str(seen), SceneRequest(stage=None))
    assert len(scene.objects) == 1
    assert scene.camera.eye.tolist() == [0, 0, 5]
    scene = read_scene(str(seen), SceneRequest(stage="studio"))
    assert len(scene.objects) == 2
    assert scene.camera.eye.tolist() == [0, 0, 5]
    sun = {"extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional"}]}}}
    lit = write_gltf(
        tmp_path / "lit.gltf",
        **sun,
        nodes=[{"mesh": 0}, {"extensions": {"KHR_lights_punctual": {"light": 0}}}],
        extensionsUsed=["KHR_lights_punctual", "KHR_materials_transmission"],
    )
    assert len(read_scene(str(lit), SceneRequest(stage=None)).objects) == 1
    scene = read_scene(str(lit), SceneRequest(stage="night"))
    assert len(scene.lights) == 1
    opaque = write_gltf(tmp_path / "opaque.gltf", materials=[{}])
    assert len(read_scene(str(opaque), SceneRequest(stage=None)).objects) == 1, "nothing to be rendered"


def test_what_is_up_stands_upright(tmp_path: Path) -> None:
    mesh = tl.Mesh([[0, 0, 0], [1, 0, 0], [0, 0, 3]], [[0, 1, 2]])
    path = tmp_path / "up.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    path.write_text("\n".join([*lines, "f 1 2 3", ""]))
    scene = read_scene(str(path), SceneRequest(camera=CameraOptions(up="0,0,1"), stage=None))
    assert np.ptp(scene.objects[0].bounds, axis=0) == pytest.approx([1, 3, 0], abs=1e-9)
    assert scene.camera.up[1] > 0.5
    eyed = read_scene(
        str(path), SceneRequest(camera=CameraOptions(up="0,0,1", eye="0,-9,2", target="0,0,2"), stage=None)
    )
    assert eyed.camera.eye == pytest.approx([0, 2, 9], abs=1e-9)
    assert eyed.camera.forward == pytest.approx([0, 0, -1], abs=1e-9)


def test_thickness_needs_no_stage() -> None:
    scene = read_scene("sphere", SceneRequest())
    assert len(scene.objects) == 1
    assert scene.environment is LIGHT_TABLE


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--stage", "studoi"), "stage 'studoi'; no stage has this name; did you mean studio?"),
        (
            ("--stage", "night", "--opaque-with", "pyrender"),
            "--stage night; not possible with --opaque-with: it draws no shadows of the stage",
        ),
    ],
)
def test_mistakes_are_told(run: Run, tmp_path: Path, options: tuple[str, ...], message: str) -> None:
    assert message in one_error_line(run("render", "bear", "-o", str(tmp_path / "a.png"), *options))
    assert not list(tmp_path.iterdir())


def test_shadows_have_the_size_and_number_asked_for(run: Run, tmp_path: Path) -> None:
    told = run("explain", "soap", "--environment-shadows", 5, "--shadow-size", 256, "--json").out
    assert "5 directions of the environment" in json.loads(told)["plan"]["passes"][0]["reason"]
    none = run("explain", "soap", "--stage", "none", "--json").out
    assert "shadow_maps" not in [step["name"] for step in json.loads(none)["plan"]["passes"]]
    output = tmp_path / "soap.npz"
    assert (
        run(
            "render",
            "soap",
            "-o",
            output,
            "--size",
            "8x8",
            "--samples",
            1,
            "--shadow-size",
            64,
            "--environment-shadows",
            5,
        ).code
        == 0
    )
    for option, message in (
        (("--shadow-size", 9), "ShadowMaps size 9; the size must be a whole number in 64 to 8192"),
        (("--environment-shadows", -1), "environment_shadows -1; the number of directions must be a whole number"),
    ):
        refused = run("render", "soap", "-o", output, *option)
        assert refused.code == 2
        assert message in refused.err
