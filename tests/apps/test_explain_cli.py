"""``translucent explain``: mesh, objects and plan, in words and as JSON, without OpenGL."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import pytest
import trimesh

from tests.apps.models import write_scene
from tests.boxes import GLASS
from tests.command_line import Run, one_error_line, strict_json
from translucent.geometry.solids import Box
from translucent.planning.scattering import SCATTERINGS


@pytest.mark.parametrize("name", ["folder", "folder.glb"])
def test_a_folder_is_no_model(run: Run, tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    result = run("explain", tmp_path / name)
    assert one_error_line(result).endswith(f"{name}'; the path is a folder; give the path of a file")


def test_a_scene_of_opaque_objects_is_refused_and_yet_explained(run: Run, tmp_path: Path) -> None:
    model = write_scene(tmp_path / "rock.glb", {})
    result = run("render", model, "-o", tmp_path / "out.png")
    line = one_error_line(result)
    assert "its 1 object is opaque: no material has KHR_materials_transmission; add --preset NAME, or --color C" in line
    assert not (tmp_path / "out.png").exists()
    result = run("explain", model)
    assert (result.code, result.err) == (0, "")
    assert "'Box 0', opaque: 12 faces, 1 x 1 x 2 m\n" in result.out
    assert "plan: none, because no object is translucent; add --preset NAME" in result.out
    assert strict_json(run("explain", model, "--json").out)["plan"] is None
    assert "plan: SignedDepth" in run("explain", model, "--preset", "merlot").out


def test_explain_tells_the_mesh_and_the_plan(run: Run, cube: Path) -> None:
    result = run("explain", cube)
    assert (result.code, result.err) == (0, "")
    for words in ("cube.ply: 8 vertices, 12 faces, 1 x 1 x 1 m", "mesh: closed, convex, 1 component", "signed_depth:"):
        assert words in result.out
    assert "transmittance: 8 read" in result.out


def test_explain_as_json(run: Run, cube: Path) -> None:
    result = run("explain", cube, "--unit", "cm", "--method", "back-face-depth", "--stage", "none", "--json")
    told = strict_json(result.out)
    assert (result.code, result.err) == (0, "")
    assert told["mesh"]["volume"] == pytest.approx(1e-6, rel=1e-12)
    assert told["plan"]["method"] == "BackFaceDepth()"
    assert told["plan"]["exact"] is True
    assert [step["name"] for step in told["plan"]["passes"]] == ["back_face_depth", "transmittance"]
    assert [step["pixel"]["written"] for step in told["plan"]["traffic"]["passes"]] == [16 + 8 + 8, 16 + 4]


def test_explain_tells_the_objects_of_a_scene(run: Run, tmp_path: Path) -> None:
    wall = {"KHR_materials_transmission": {"transmissionFactor": 1}}
    tint = {"baseColorFactor": [0.5, 0.5, 0.5, 1]}
    model = write_scene(
        tmp_path / "scene.glb", {"extensions": GLASS}, {"extensions": wall, "pbrMetallicRoughness": tint}
    )
    result = run("explain", model)
    assert (result.code, result.err) == (0, "")
    for words in (
        "scene.glb: 2 objects, 2 of them translucent, 0 lights, 11 x 1 x 2 m",
        "'Box 0', body: 12 faces, 1 x 1 x 2 m; closed, convex, 1 component",
        "'Box 1', thin wall: 12 faces",
        "medium: 'Box 0': extinction 2.773, 1.386, 0 1/m",
        "medium: 'Box 1': thin-walled: white light is #bcbcbc behind it",
        "plan: SignedDepth",
    ):
        assert words in result.out
    told = strict_json(run("explain", model, "--json").out)
    assert [item["kind"] for item in told["objects"]] == ["body", "thin wall"]
    assert told["objects"][0]["extinction"] == pytest.approx([4 * math.log(2), 2 * math.log(2), 0.0], rel=1e-14)
    assert (told["lights"], told["left_out"]) == (0, [])
    assert told["plan"]["passes"][-1]["name"] == "traced_interfaces"
    assert told["plan"]["interfaces"] == "TracedInterfaces(depth=24, forks=2)"
    assert "approximation: rays that cross more than 24 interfaces, or follow the weaker of" in result.out
    told = strict_json(run("explain", model, "--interfaces", "screen", "--json").out)
    assert told["plan"]["passes"][-1]["name"] == "surfaces"
    assert told["plan"]["interfaces"] == "ScreenInterfaces()"
    assert told["plan"]["given_back"] is None


def test_explain_says_how_light_scattered_many_times_is_shown(run: Run, cube: Path) -> None:
    milk = ("explain", cube, "--scattering-color", "white", "--mean-free-path", "1cm", "--json")
    told = {name: strict_json(run(*milk, "--scattering", name).out)["plan"] for name in SCATTERINGS}
    assert told["diffusion"]["given_back"] == "diffuses (Diffusion(resolution=32)) in 1 body"
    assert told["layer"]["given_back"] == "leaves as from flat layers in 1 body"
    assert told["single"]["given_back"] is None
    assert strict_json(run(*milk).out)["plan"] == told["diffusion"]


def test_explain_says_what_is_black(run: Run) -> None:
    plan = strict_json(run("explain", "wine", "--preset", "merlot", "--json").out)["plan"]
    (remark,) = plan["remarks"]
    assert remark.startswith("'wine.ply': black: only 1.6e-03 of white light passes 42.1 mm, the mean thickness")
    assert f"  remark: {remark}\n" in run("explain", "wine", "--preset", "merlot").out
    assert "remark" not in run("explain", "bear", "--preset", "merlot").out


def test_what_a_scene_leaves_out_is_a_warning_line(run: Run, tmp_path: Path) -> None:
    coated = GLASS | {"KHR_materials_clearcoat": {"clearcoatTexture": {"index": 0}}}
    model = write_scene(tmp_path / "scene.glb", {"extensions": coated, "name": "Glass"})
    with warnings.catch_warnings():
        warnings.simplefilter("always")  # pytest turns warnings into errors, which nothing else does
        result = run("explain", model, "--json")
    lost = "textures of clear coats ('Glass')"
    assert result.err.splitlines() == [f"warning: scene 'scene.glb': left out: {lost}"]
    assert strict_json(result.out)["left_out"] == [lost]


def test_explain_needs_no_opengl(run: Run, cube: Path, no_opengl: None) -> None:
    assert run("explain", cube).code == 0


def test_a_repair_is_a_warning_line_and_no_part_of_the_json(run: Run, tmp_path: Path) -> None:
    box = trimesh.creation.box((1, 1, 1))
    path = tmp_path / "inverted.off"
    trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False).export(path)
    with warnings.catch_warnings():
        warnings.simplefilter("always")  # pytest turns warnings into errors, which nothing else does
        result = run("explain", path, "--json")
    assert result.code == 0
    assert result.err.splitlines() == ["warning: mesh 'inverted.off': flipped 1 closed part outwards"]
    assert strict_json(result.out)["mesh"]["repairs"] == ["flipped 1 closed part outwards"]


def test_the_size_of_a_model_is_said_and_may_be_requested(run: Run, tmp_path: Path) -> None:
    model = tmp_path / "cow.obj"
    box = Box((0, 0, 0), (1, 1.7, 1)).tessellate()
    trimesh.Trimesh(box.vertices, box.faces, process=False).export(model)
    assert "\nsize: 1.7 m tall; taken as metres; for a figurine --height 12cm\n" in run("explain", model).out
    assert "size:" not in run("explain", model, "--unit", "m").out
    for size in (["--height", "17cm"], ["--longest", "17cm"], ["--unit", "10cm"]):
        assert strict_json(run("explain", model, *size, "--json").out)["mesh"]["bounds"][1] == [0.1, 0.17, 0.1]
    refused = run("explain", model, "--unit", "mm", "--height", "12cm")
    assert refused.code == 2
    assert refused.err == "error: --unit mm; --height is given, too; both options scale the model: use one of them\n"
    wax = run("explain", model, "--preset", "wax").out
    assert "'cow.obj': opaque at this size, like plastic" in wax


def test_a_color_is_that_of_a_solid_unless_it_is_asked_for_without_an_interface(run: Run) -> None:
    color = ("--color", "#ace5c9", "--distance", "25cm")
    passes = [step["name"] for step in strict_json(run("explain", "bear", *color, "--json").out)["plan"]["passes"]]
    assert "traced_interfaces" in passes
    fog = strict_json(run("explain", "bear", *color, "--ior", "1", "--json").out)["plan"]
    assert fog["interfaces"] is None
    clear = run("explain", "bear", "--color", "white", "--distance", "1cm")
    assert clear.err.startswith(
        "note: --color white absorbs no light, so the medium looks like clear glass; for white wax or"
    )
