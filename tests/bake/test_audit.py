"""The audit of glTF materials: what is right stays unremarked, each mistake is found by its code, and mended."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.command_line import Run, one_error_line, strict_json
from tests.gltf.gltf_writer import Writer, glass
from translucent.bake.audit.rules import scale_errors
from translucent.gltf.file import read_gltf
from translucent.gltf.materials import read_materials
from translucent.media.colors import parse_color

Json = dict[str, Any]

BALL = trimesh.creation.icosphere(subdivisions=2, radius=0.01)
#: How far its facets are inside of the ball, as a share of the radius.
SAGITTA = 1 - float(np.linalg.norm(BALL.triangles_center, axis=1).min()) / 0.01
MATT: Json = {"metallicFactor": 0}
SOUND: Json = glass(thickness=0.0175, attenuationColor=[0.2, 0.5, 0.8], attenuationDistance=0.02)
DENSE: Json = {"attenuationColor": [0.2, 0.5, 0.8], "attenuationDistance": 0.02}


def model(
    path: Path,
    thickness: float | None = 0.0175,
    mesh: trimesh.Trimesh = BALL,
    node: Json | None = None,
    material: Json | None = None,
    uv: np.ndarray | None = None,
    **volume: Any,
) -> Path:
    """One body with this thickness; the default file is right."""
    writer = Writer()
    extensions = glass(thickness=thickness, ior=1.5, **{**DENSE, **volume})
    known = {"name": "Glass", "pbrMetallicRoughness": MATT, "extensions": extensions, **(material or {})}
    primitive = writer.primitive(mesh, material=writer.material(**known))
    if uv is not None:
        primitive["attributes"]["TEXCOORD_0"] = writer.accessor(uv)
    writer.mesh(primitive)
    bounds = {"min": mesh.vertices.min(axis=0).tolist(), "max": mesh.vertices.max(axis=0).tolist()}
    writer.tree["accessors"][1] |= bounds
    writer.tree["extensionsUsed"] = sorted(known["extensions"])
    writer.add("nodes", mesh=0, name="Ball", **(node or {}))
    writer.add("scenes", nodes=[0])
    return writer.save(path)


def codes(path: Path) -> set[str]:
    return set(tl.check_materials(path).codes)


# What is right


@pytest.mark.parametrize("thickness", [0.02, 0.0133, 0.0175])
def test_nothing_is_found_in_a_right_file(tmp_path: Path, thickness: float) -> None:
    """The diameter, the mean chord of 4/3 radius, and what lies between are all honest factors of a ball."""
    found = tl.check_materials(model(tmp_path / "ball.glb", thickness))
    assert found.findings == ()
    assert str(found) == "no findings"


def test_the_true_thickness_of_a_ball(tmp_path: Path) -> None:
    (body,) = tl.check_materials(model(tmp_path / "ball.glb")).bodies
    assert body["along_normals"]["median"] == pytest.approx(0.02, rel=SAGITTA)
    # Of chords with density 2 c / D^2 the median is D / sqrt(2).
    assert body["along_views"]["median"] == pytest.approx(0.02 / math.sqrt(2), rel=SAGITTA + 0.01)
    assert body["closed"]
    assert body["escaped"] == 0


def test_viewers_are_predicted_by_their_formulas(tmp_path: Path) -> None:
    (body,) = tl.check_materials(model(tmp_path / "ball.glb", 0.02, node={"scale": [2, 2, 2]})).bodies
    colors = {name: np.array(color) for name, color in body["colors"].items()}
    passing = np.array(DENSE["attenuationColor"])
    np.testing.assert_allclose(colors["three.js"], passing**2, rtol=1e-9)  # 4 cm, whatever the angle
    # The mean of exp(-s c) over the chords of a ball of diameter D = 0.04.
    s = -np.log(passing) / 0.02 * 0.04
    mean = 2 * (1 - (1 + s) * np.exp(-s)) / s**2
    np.testing.assert_allclose(colors["true"], mean, atol=0.015)
    assert (colors["three.js"] < colors["Filament"]).all()
    assert (colors["Blender (Cycles)"] > colors["true"]).all()  # 1 - c is less than -ln c


# Thickness


@pytest.mark.parametrize(("factor", "code"), [(10.0, "thickness-too-large"), (0.1, "thickness-too-small")])
def test_a_wrong_factor_is_found_and_mended(tmp_path: Path, run: Run, factor: float, code: str) -> None:
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    path = model(tmp_path / "ball.glb", 0.02 * factor)
    (found,) = tl.check_materials(path).findings
    assert (found.severity, found.code, found.material, found.place) == ("error", code, 0, (0, 0))
    assert found.where == "material 0 'Glass', mesh 'Ball', node 'Ball'"
    out = tmp_path / "out.glb"
    if code == "thickness-too-small":
        return  # mended alike
    arguments = ("material", "check", path, "--fix", "-o", out, "--size", "64", "--rays", "16", "--json")
    code_, text, _ = run(*arguments)
    told = strict_json(text)
    assert code_ == 0
    assert (told["counts"]["error"], told["fixed"]["findings"]) == (1, [])
    before, after = read_gltf(path), read_gltf(out)
    (material,) = read_materials(out)
    assert material.has_thickness_texture
    assert material.attenuation_distance == 0.02
    assert material.thickness == pytest.approx(0.0133, rel=0.06)
    assert after.resource({}).startswith(before.resource({}))  # what was there keeps its bytes


@pytest.mark.filterwarnings("ignore::translucent.errors.TranslucentWarning")  # of the bake
@pytest.mark.parametrize(("shrunk", "code"), [(1.0, 0), (1e-4, 1)])
def test_a_map_in_which_faces_have_no_texels_is_an_error(tmp_path: Path, run: Run, shrunk: float, code: int) -> None:
    """All UVs in a spot: the bake has one texel for all faces, and no success is reported."""
    soup = BALL.copy()
    soup.unmerge_vertices()
    cells = np.stack(np.divmod(np.arange(len(soup.faces)), 18), axis=-1)[:, None] + [[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]]
    uv = np.empty((len(soup.vertices), 2))
    uv[soup.faces] = cells / 18
    path, out = model(tmp_path / "ball.glb", 0.2, soup, uv=0.5 + shrunk * (uv - 0.5)), tmp_path / "out.glb"
    found = run("material", "check", path, "--fix", "-o", out, "--size", "64", "--rays", "8", "--json")
    assert found.code == code
    told = [(one["severity"], one["code"]) for one in strict_json(found.out)["fixed"]["findings"]]
    assert (("error", "map-without-texels") in told) == bool(code)
    if code:
        assert "100% of the faces have no texel" in found.out or "99% of the faces have no texel" in found.out
        assert "unwrap the mesh" in found.err


def test_thickness_zero_shows_none_of_the_attenuation(tmp_path: Path) -> None:
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    (found,) = tl.check_materials(model(tmp_path / "ball.glb", 0.0)).findings
    assert (found.severity, found.code) == ("error", "thickness-zero")
    assert tl.fix_materials(tmp_path / "ball.glb", tmp_path / "out.glb", size=64, rays=16).findings == ()


def test_without_attenuation_a_wrong_factor_is_a_warning(tmp_path: Path) -> None:
    path = model(tmp_path / "ball.glb", 0.2, attenuationColor=[1, 1, 1])
    (found,) = tl.check_materials(path).findings
    assert (found.severity, found.code) == ("warning", "thickness-too-large")
    assert "the medium is clear" in found.text


def test_a_shell_that_is_taken_for_a_solid(tmp_path: Path) -> None:
    inner = BALL.copy().apply_scale(0.9)
    inner.invert()
    shell = trimesh.util.concatenate([BALL, inner])
    found = tl.check_materials(model(tmp_path / "shell.glb", 0.02, shell)).findings
    assert [(one.severity, one.code) for one in found] == [("error", "shell-as-solid")]
    assert "walls of 0.000988" in found[0].text
    right = tl.check_materials(model(tmp_path / "right.glb", 0.001, shell))
    assert right.findings == ()
    # Along a view that passes the center at s radii: both walls, and only those views that come from outside.
    s2 = (np.arange(10000) + 0.5) / 10000
    chords = np.sqrt(1 - s2) - np.sqrt(np.maximum(0.81 - s2, 0))
    assert right.bodies[0]["along_views"]["median"] == pytest.approx(0.02 * np.median(chords), rel=SAGITTA + 0.05)
    assert right.bodies[0]["along_views"]["p95"] == pytest.approx(0.02 * np.percentile(chords, 95), rel=0.05)


def textured(path: Path, image: np.ndarray) -> Path:
    """A slim wedge that thickens along x, with a thickness texture whose rows go from thin to thick."""
    import io

    from PIL import Image

    box = trimesh.creation.box((1.0, 0.02, 0.02))
    wedge = trimesh.Trimesh(
        box.vertices * np.column_stack([np.ones(8), *[1 + box.vertices[:, 0] * 1.8] * 2]), box.faces
    )
    wedge = wedge.subdivide().subdivide().subdivide()
    uv = np.column_stack([np.full(len(wedge.vertices), 0.5), wedge.vertices[:, 0] + 0.5])  # v downwards
    writer, stream = Writer(), io.BytesIO()
    Image.fromarray(image).save(stream, format="PNG")
    view = writer.view(stream.getvalue())
    writer.add("images", bufferView=view, mimeType="image/png")
    writer.add("textures", source=0)
    volume = {"thicknessTexture": {"index": 0}, **DENSE}
    material = {"pbrMetallicRoughness": MATT, "extensions": glass(thickness=0.04, **volume)}
    primitive = writer.primitive(wedge, material=writer.material(**material))
    primitive["attributes"]["TEXCOORD_0"] = writer.accessor(uv)
    writer.mesh(primitive)
    writer.add("nodes", mesh=0)
    return writer.save(path)


def test_an_inverted_map_is_told_from_a_right_one(tmp_path: Path) -> None:
    ramp = np.zeros((256, 4, 3), np.uint8)
    ramp[..., 1] = np.linspace(20, 240, 256)[:, None]
    assert codes(textured(tmp_path / "right.glb", ramp)) == set()
    assert "thickness-map-inverted" in codes(textured(tmp_path / "inverted.glb", ramp[::-1]))
    half = ramp.copy()
    half[128:] = 0
    assert "thickness-map-empty" in codes(textured(tmp_path / "empty.glb", half))
    red = ramp[..., [1, 0, 2]]  # only G counts
    assert "thickness-map-empty" in codes(textured(tmp_path / "red.glb", red))


# Size and attenuation


def test_a_ball_of_centimetres_in_a_file_of_metres(tmp_path: Path) -> None:
    large = BALL.copy().apply_scale(100.0)
    found = tl.check_materials(model(tmp_path / "ball.glb", 1.75, large)).findings
    assert [one.code for one in found] == ["attenuation-black", "units-suspect"]
    assert "at a thickness of 1.4 m, the body is black; at 14 mm, it would be" in found[1].text
    assert "scale the node by 0.01" in found[1].do
    clear = model(tmp_path / "clear.glb", attenuationDistance=20.0)
    assert {"attenuation-none", "units-suspect"} <= codes(clear)
    weak = model(tmp_path / "weak.glb", 1.75, large, attenuationDistance=1.0)
    assert codes(weak) == {"size-unusual"}


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"material": {"pbrMetallicRoughness": {}}}, "metal"),
        ({"material": {"doubleSided": True}}, "double-sided"),
        ({"attenuationColor": [0, 0.5, 0.8]}, "attenuation-zero"),
        ({"material": {"extensions": {"KHR_materials_volume": {"thicknessFactor": 1, **DENSE}}}}, "no-light-enters"),
        ({"material": {"extensions": glass(thickness=0.0175, ior=1.0, **DENSE)}}, "ior-one"),
        ({"material": {"extensions": glass(thickness=0.0175, ior=4.0, **DENSE)}}, "ior-large"),
        ({"material": {"extensions": {**SOUND, "KHR_materials_unlit": {}}}}, "excluded-extension"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_a_slip_of_the_material_is_found(tmp_path: Path, change: Json, code: str) -> None:
    assert codes(model(tmp_path / "ball.glb", **change)) == {code}


def test_slips_that_a_file_tells_how_to_mend_are_mended(tmp_path: Path) -> None:
    material: Json = {"pbrMetallicRoughness": {}, "doubleSided": True}
    path = model(tmp_path / "ball.glb", material=material)
    before = copy.deepcopy(read_gltf(path).tree)
    assert tl.fix_materials(path, tmp_path / "out.glb").findings == ()
    after = read_gltf(tmp_path / "out.glb").tree
    assert after["materials"][0]["pbrMetallicRoughness"] == MATT
    del before["materials"][0]["doubleSided"]
    before["materials"][0]["pbrMetallicRoughness"] = MATT
    assert after == before


# Meshes and nodes


def test_holes_and_winding_are_found(tmp_path: Path) -> None:
    cap = trimesh.Trimesh(BALL.vertices, BALL.faces[BALL.triangles_center[:, 2] < 0.005])
    (found,) = tl.check_materials(model(tmp_path / "open.glb", mesh=cap)).findings
    assert (found.severity, found.code) == ("error", "open-mesh")
    pricked = trimesh.Trimesh(BALL.vertices, BALL.faces[1:])
    (found,) = tl.check_materials(model(tmp_path / "pricked.glb", mesh=pricked)).findings
    assert (found.severity, found.code) == ("warning", "open-mesh")
    turned = BALL.faces.copy()
    turned[:9] = turned[:9, ::-1]
    assert codes(model(tmp_path / "mixed.glb", mesh=trimesh.Trimesh(BALL.vertices, turned, process=False))) == {
        "winding"
    }
    inside_out = trimesh.Trimesh(BALL.vertices, BALL.faces[:, ::-1], process=False)
    assert codes(model(tmp_path / "inverted.glb", mesh=inside_out)) == {"winding"}


def test_a_mirrored_node_is_no_mistake(tmp_path: Path) -> None:
    assert codes(model(tmp_path / "ball.glb", node={"scale": [-1, 1, 1]})) == set()


def test_a_turned_stretch_is_told_with_its_error(tmp_path: Path) -> None:
    """The node's own axes are turned: columns of R S have the lengths of S, which viewers put on world axes."""
    assert codes(model(tmp_path / "even.glb", node={"scale": [3, 3, 3], "rotation": [0, 0, 0.6, 0.8]})) == set()
    turned = {"scale": [1, 3, 1], "rotation": [0, 0, math.sin(math.pi / 8), math.cos(math.pi / 8)]}
    (found,) = tl.check_materials(model(tmp_path / "turned.glb", node=turned)).findings
    assert (found.severity, found.code) == ("warning", "scale-uneven")
    matrix = np.array([[1, -3, 0], [1, 3, 0], [0, 0, math.sqrt(2)]]) / math.sqrt(2)
    least, most = scale_errors(matrix)
    assert f"use {least:.2f} to {most:.2f}" in found.text
    along = np.array([1.0, 1.0, 0.0]) / math.sqrt(2)  # the image of x, which the node leaves as long as it is
    true = 1.0 / float(np.linalg.norm(np.linalg.solve(matrix, along)))
    assert true == pytest.approx(1.0)
    assert most >= np.linalg.norm(along * (1, 3, 1)) / true - 1e-12
    assert scale_errors(np.diag([2.0, -2.0, 2.0])) == pytest.approx((1.0, 1.0))


@pytest.mark.parametrize(("away", "code"), [(0.012, "overlap"), (0.0, "nested"), (0.03, None)])
def test_bodies_that_share_space(tmp_path: Path, away: float, code: str | None) -> None:
    writer = Writer()
    material = {"pbrMetallicRoughness": MATT, "extensions": glass(thickness=0.0175, **DENSE)}
    for mesh in (BALL, BALL.copy().apply_scale(0.8)):
        writer.mesh(writer.primitive(mesh, material=writer.material(**copy.deepcopy(material))))
    writer.add("nodes", mesh=0, name="Outer")
    writer.add("nodes", mesh=1, name="Inner", translation=[away, 0, 0])
    assert codes(writer.save(tmp_path / "two.glb")) == ({code} if code else set())


def test_what_takes_too_long_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("translucent.bake.audit.rules.MOST_WORK", 1000)
    writer = Writer()
    material = writer.material(pbrMetallicRoughness=MATT, extensions=SOUND)
    writer.mesh(writer.primitive(BALL, material=material))
    for away in (0.0, 0.012):
        writer.add("nodes", mesh=0, translation=[away, 0, 0])
    assert codes(writer.save(tmp_path / "two.glb")) == {"overlap-unchecked"}


def test_a_body_in_two_primitives_is_one(tmp_path: Path) -> None:
    top = BALL.triangles_center[:, 2] > 0
    writer = Writer()
    for half in (top, ~top):
        extensions = glass(thickness=0.0175, **DENSE)
        material = writer.material(pbrMetallicRoughness=MATT, extensions=extensions)
        part = writer.primitive(trimesh.Trimesh(BALL.vertices, BALL.faces[half]), material=material)
        writer.tree.setdefault("parts", []).append(part)
    writer.mesh(*writer.tree.pop("parts"))
    writer.add("nodes", mesh=0)
    found = tl.check_materials(writer.save(tmp_path / "halves.glb"))
    assert found.findings == ()
    assert [body["along_normals"]["median"] for body in found.bodies] == pytest.approx([0.02, 0.02], rel=SAGITTA)


# The command line


def test_the_verb_tells_findings_and_fails_for_errors(run: Run, tmp_path: Path) -> None:
    code, out, err = run("material", "check", model(tmp_path / "wrong.glb", 0.2))
    assert code == 1
    assert err.count("\n") == 1
    assert "1 finding of severity error; set thicknessFactor to 0.0132 to 0.0198 (--fix bakes a map)" in err
    lines = out.splitlines()
    assert lines[0].endswith("1 translucent body; 1 error, 0 warnings, 0 notes")
    assert lines[1] == "error   thickness-too-large: material 0 'Glass', mesh 'Ball', node 'Ball'"
    shown = lines[-1].split("three.js ")[1].split(",")[0]
    np.testing.assert_allclose(parse_color(shown), np.array(DENSE["attenuationColor"]) ** 10, atol=3e-3)
    code, out, err = run("material", "check", model(tmp_path / "right.glb"), "--json")
    assert (code, err) == (0, "")
    assert strict_json(out)["counts"] == {"error": 0, "warning": 0, "note": 0}


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--fix",), "--fix; -o OUTPUT is missing; these options belong together: give both, or neither"),
        (("-o", "out.glb"), "-o out.glb; --fix is missing; these options belong together: give both, or neither"),
        (("--fix", "-o", "out.gltf"), "suffix '.gltf'; use .glb, which also holds the thickness maps"),
    ],
)
def test_what_is_asked_in_halves_is_refused(run: Run, tmp_path: Path, options: tuple[str, ...], told: str) -> None:
    assert one_error_line(run("material", "check", model(tmp_path / "ball.glb"), *options)).endswith(told)


def test_the_validator_accepts_a_mended_file(validate: Any, tmp_path: Path) -> None:
    pytest.importorskip("xatlas", reason="xatlas makes the UVs")
    path = model(tmp_path / "ball.glb", 0.3, material={"doubleSided": True})
    assert tl.fix_materials(path, tmp_path / "out.glb", size=64, rays=16).findings == ()
    issues = validate(tmp_path / "out.glb")
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues


# Files of others


def test_the_answer_key_of_attenuation_is_right(assets: Path) -> None:
    """Its blocks state what they are, by factor, texture and scale of nodes; that they are of metres is a note."""
    found = tl.check_materials(assets / "gltf" / "AttenuationTest.glb")
    assert found.codes == ("size-unusual",)
    assert len(found.bodies) == 16
