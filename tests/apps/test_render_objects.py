"""``translucent render``: media for single objects, variants and times of glTF files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.apps.models import write_scene
from tests.boxes import GLASS
from tests.command_line import Result, Run, one_error_line
from translucent.commands.model import NamedMedium, SceneRequest, _grouped, read_scene
from translucent.gltf.file import read_gltf, write_gltf

MERLOT, JADE = tl.preset("merlot").medium, tl.preset("jade").medium


@pytest.fixture
def bar(tmp_path: Path) -> Path:
    """Three boxes: one of glass, one of glass that is red in a variant, and an opaque one that can fall."""
    path = write_scene(tmp_path / "bar.glb", {"extensions": GLASS}, {"extensions": GLASS}, {"name": "Wood"})
    file = read_gltf(path)
    tree = file.tree
    tree["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "Wooden"}]}}
    mapping = {"mappings": [{"material": 2, "variants": [0]}]}
    tree["meshes"][1]["primitives"][0]["extensions"] = {"KHR_materials_variants": mapping}
    write_gltf(file, path)
    return path


@pytest.fixture
def shown(run: Run, bar: Path, tmp_path: Path) -> Any:
    def _shown(*options: object) -> Result:
        small = ("-o", tmp_path / "a.png", "--size", "24x16", "--samples", "1", "--stage", "none")
        return run("render", bar, *small, *options)

    return _shown


# Which options belong to which object


@pytest.mark.parametrize(
    ("line", "rest", "groups"),
    [
        (
            "m --preset a --object X --color c --distance=1 -o o",
            "m --preset a --object X -o o",
            ["--color c --distance=1"],
        ),
        ("--object X --preset a m --object=Y --clamp -o o", "--object X m --object=Y -o o", ["--preset a", "--clamp"]),
        ("m --preset a", "m --preset a", []),
        ("--object X --roughness 0 -- --preset", "--object X -- --preset", ["--roughness 0"]),
        ("--object X --preset a --json --debug", "--object X --json --debug", ["--preset a"]),
        ("--object", "--object", [""]),
        ("--object X --preset", "--object X", ["--preset"]),
    ],
)
def test_options_of_a_medium_belong_to_the_object_before_them(line: str, rest: str, groups: list[str]) -> None:
    assert _grouped(line.split()) == (rest.split(), [group.split() for group in groups])


# Scenes


def media(scene: tl.Scene) -> dict[str, tl.Medium | None]:
    return {item.mesh.name: item.medium for item in scene.objects}


def test_named_objects_have_their_media_and_roughness(bar: Path) -> None:
    named = [NamedMedium("Box 0", MERLOT, None), NamedMedium("Box 2", JADE, 0.15)]
    scene = read_scene(str(bar), SceneRequest(roughness=0.5, media=named))
    found = media(scene)
    assert (found["Box 0"], found["Box 2"]) == (MERLOT, JADE)
    assert found["Box 1"] not in (None, MERLOT, JADE)
    rough = {item.mesh.name: item.surface.roughness if item.surface else 0.0 for item in scene.objects}
    # That of the others is not theirs.
    assert (rough["Box 1"], rough["Box 2"]) == (0.5, 0.15)
    assert rough["Box 0"] != 0.5


def test_others_have_the_medium_that_is_said_first(bar: Path) -> None:
    found = media(read_scene(str(bar), SceneRequest(medium=JADE, media=[NamedMedium("Box 0", MERLOT, None)])))
    assert found == {"Box 0": MERLOT, "Box 1": JADE, "Box 2": None}


def test_parts_of_an_object_are_meant_by_its_name(bar: Path) -> None:
    file = read_gltf(bar)
    primitives = file.tree["meshes"][0]["primitives"]
    primitives.append(dict(primitives[0]))
    write_gltf(file, bar)
    found = media(read_scene(str(bar), SceneRequest(media=[NamedMedium("Box 0", MERLOT, None)])))
    assert (found["Box 0[0]"], found["Box 0[1]"]) == (MERLOT, MERLOT)
    found = media(read_scene(str(bar), SceneRequest(media=[NamedMedium("Box 0[1]", MERLOT, None)])))
    assert found["Box 0[0]"] != found["Box 0[1]"] == MERLOT


def test_a_mesh_has_one_object(cube: Path) -> None:
    name = read_scene(str(cube), SceneRequest()).objects[0].mesh.name
    found = media(read_scene(str(cube), SceneRequest(media=[NamedMedium(name, MERLOT, None)])))
    assert found == {name: MERLOT}


# The command line


@pytest.fixture
def scene(shown: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The scene that a command line would render, which takes seconds and is tried elsewhere."""

    class Enough(tl.InputError):
        pass

    def _scene(*options: object) -> tl.Scene:
        read: list[tl.Scene] = []

        def spy(*given: Any, **more: Any) -> tl.Scene:
            read.append(read_scene(*given, **more))
            raise Enough("a test", "it has the scene", "stop")

        monkeypatch.setattr("translucent.commands.render.read_scene", spy)
        assert "it has the scene" in one_error_line(shown(*options))
        return read[0]

    return _scene


def test_each_object_has_its_medium(scene: Any) -> None:
    wine, other = ("--object", "Box 0", "--preset", "merlot"), ("--object", "Box 2", "--color", "#808080")
    found = media(scene("--preset", "jade", *wine, *other, "--distance", "1cm"))
    assert (found["Box 0"], found["Box 1"]) == (MERLOT, JADE)
    np.testing.assert_allclose(found["Box 2"].extinction, tl.Medium.from_color("#808080", 0.01).extinction)


def test_a_variant_and_its_names(shown: Any, scene: Any) -> None:
    assert media(scene("--variant", "Wooden"))["Box 1"] is None
    assert media(scene())["Box 1"] is not None
    assert "did you mean Wooden? use one of Wooden" in one_error_line(shown("--variant", "Wood"))


def test_a_time(shown: Any, bar: Path) -> None:
    assert "the file has no animations; omit the time" in one_error_line(shown("--time", "1"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            "--object Glas --preset merlot",
            "object 'Glas'; no object has this name; use one of 'Box 0', 'Box 1', 'Box 2'",
        ),
        ("--object Box --preset merlot", "did you mean Box 2, Box 1 or Box 0?"),
        ("--object Glass", "--object 'Glass'; no medium is given for this object; after the name, add --preset NAME"),
        (
            "--object A --preset merlot --object A --preset jade",
            "--object 'A'; the object is named twice; give the object one medium",
        ),
        ("--object A --preset merlott", "preset 'merlott'; no preset has this name; did you mean merlot"),
        ("--object A --color red", "--color; --distance is missing"),
        ("--object A --roughness 2", "Invalid value for '--roughness'"),
        ("--object A --preset", "Option '--preset' requires an argument"),
        ("--object", "Option '--object' requires an argument"),
    ],
)
def test_what_is_wrong_is_one_line(shown: Any, options: str, message: str) -> None:
    assert message in one_error_line(shown(*options.split()))


@pytest.mark.parametrize(("option", "value"), [("--variant", "Red"), ("--time", "1.0")])
def test_a_mesh_has_no_variants_and_no_time(run: Run, cube: Path, tmp_path: Path, option: str, value: str) -> None:
    line = one_error_line(run("render", cube, "-o", tmp_path / "a.png", option, value))
    assert f"{option} {value}; {cube} is not a glTF file; omit the option" in line
