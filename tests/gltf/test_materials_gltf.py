"""glTF volume materials read: the validator's verdicts, the attenuation answer key, thickness under transforms."""

from __future__ import annotations

import base64
import io
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from tests.gltf.gltf_json import gltf, uses
from translucent.formulas import optics
from translucent.gltf.file import GltfFile, read_gltf
from translucent.gltf.materials import GltfMaterial, materials_of, read_materials
from translucent.gltf.nodes import node_transforms, thickness_at, thickness_map
from translucent.gltf.textures import TextureTransform
from translucent.media.medium import BLACKEST

COLOR = (0.1, 0.5, 0.9)

Json = dict[str, Any]


def volume(transmission: float = 1.0, **fields: Any) -> Json:
    return {
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": transmission},
            "KHR_materials_volume": fields,
        }
    }


def transformed(**transform: Any) -> Json:
    """A volume whose thickness texture, the file's first, is transformed."""
    texture = {"index": 0, "texCoord": 1, "extensions": {"KHR_texture_transform": transform}}
    return volume(thicknessFactor=2.0, thicknessTexture=texture)


def parsed(*materials: Json, **more: Any) -> list[GltfMaterial]:
    return materials_of(GltfFile(Path("a.gltf"), gltf(*materials, **more)))


def world_length(transform: np.ndarray) -> float:
    """World length of 1 in mesh space, along the world's z axis."""
    return 1.0 / float(np.linalg.norm(np.linalg.solve(transform[:3, :3], (0.0, 0.0, 1.0))))


# Reading


def test_the_defaults_are_those_of_the_extensions() -> None:
    bare, thin, solid = parsed({}, volume(), volume(thicknessFactor=2.0))
    assert (bare.transmission, bare.ior, bare.has_volume, bare.medium()) == (0.0, 1.5, False, None)
    assert (thin.thickness, thin.attenuation_distance, thin.attenuation_color) == (0.0, math.inf, (1, 1, 1))
    assert thin.medium() is None
    assert solid.medium() == tl.Medium(ior=1.5)
    np.testing.assert_array_equal(solid.medium().transmittance(1e9), 1.0)


def test_all_fields_are_read() -> None:
    entry = volume(0.75, thicknessFactor=2, attenuationColor=[0.1, 0.5, 0.9], attenuationDistance=0.5)
    entry["name"] = "Gem"
    entry["emissiveFactor"] = [0.5, 0, 1]
    entry["extensions"] |= {
        "KHR_materials_ior": {"ior": 2.4},
        "KHR_materials_dispersion": {"dispersion": 0.36},
        "KHR_materials_emissive_strength": {"emissiveStrength": 4},
    }
    entry["extensions"]["KHR_materials_volume"]["thicknessTexture"] = {"index": 1}
    (found,) = parsed(entry, textures=[{}, {}])
    assert (found.name, found.transmission, found.ior, found.thickness) == ("Gem", 0.75, 2.4, 2.0)
    assert (found.dispersion, found.emissive, found.thickness_texture) == (0.36, (2.0, 0.0, 4.0), 1)
    assert found.has_thickness_texture
    medium = found.medium()
    assert medium.ior == 2.4
    np.testing.assert_allclose(medium.transmittance(0.5), COLOR, rtol=1e-15)


def test_the_distance_is_where_the_color_is_and_no_mean_free_path() -> None:
    # The extension's text calls it the average distance between interactions, which its formula has only at 1/e.
    half, one = parsed(
        volume(thicknessFactor=1, attenuationColor=[0.5] * 3, attenuationDistance=2),
        volume(thicknessFactor=1, attenuationColor=[math.exp(-1)] * 3, attenuationDistance=2),
    )
    np.testing.assert_allclose(half.medium().transmittance(2.0), 0.5, rtol=1e-15)
    np.testing.assert_allclose(1 / half.medium().extinction, 2 / math.log(2), rtol=1e-15)
    np.testing.assert_allclose(1 / one.medium().extinction, 2.0, rtol=1e-15)


def test_a_black_channel_is_finite_and_said() -> None:
    (found,) = parsed(volume(thicknessFactor=1, attenuationColor=[0, 0.5, 1], attenuationDistance=2))
    medium = found.medium()
    np.testing.assert_allclose(medium.transmittance(2.0), (BLACKEST, 0.5, 1.0), rtol=1e-14)
    assert np.isfinite(medium.transmittance([0.0, 1e9])).all()
    assert "attenuationColor red is 0 and was read as 1e-05" in found.warnings[0]


def test_an_opaque_material_has_no_medium_however_thick() -> None:
    opaque, clear = (
        parsed(volume(t, thicknessFactor=1, attenuationColor=[0.5] * 3, attenuationDistance=1))[0] for t in (0.0, 1.0)
    )
    assert opaque.medium() is None
    assert clear.medium() is not None


def test_a_material_shows_its_name_and_its_colors() -> None:
    glass = volume(thicknessFactor=1, attenuationColor=[1, 0, 0], attenuationDistance=0.5)
    found = parsed({**glass, "name": "<i>Wine</i>"}, volume(), {}, volume(thicknessFactor=1))
    assert [material.kind for material in found] == ["volume", "thin wall", "opaque", "volume"]
    html = [material._repr_html_() for material in found]
    assert html[0].startswith("<div>0 &#x27;&lt;i&gt;Wine&lt;/i&gt;&#x27;: volume</div>")
    assert "500 mm<br>#ff0000" in html[0]
    assert [text.count("background:#") for text in html] == [5, 0, 0, 5]
    assert "1 m<br>#ffffff" in html[3]


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        (volume(thicknessFactor="thick"), "thicknessFactor is 'thick', not a number"),
        (volume(thicknessFactor=True), "thicknessFactor is True, not a number"),
        (volume(attenuationColor=[0.1, 0.2]), "attenuationColor is [0.1, 0.2], not three numbers"),
        (volume(attenuationColor=[0.1, 0.2, "b"]), "attenuationColor[2] is 'b', not a number"),
        (volume(attenuationColor=[0.1, 0.2, 2]), "attenuationColor[2] 2 is not in 0..1"),
        (volume(attenuationDistance=0), "attenuationDistance 0 is not above 0"),
        (volume(attenuationDistance=-1), "attenuationDistance -1 is not above 0"),
        (volume(thicknessTexture={"index": 3}), "thicknessTexture has the index 3, but the file has 0 textures"),
        (volume(thicknessTexture=3), "thicknessTexture is 3, not an object"),
        (transformed(offset=[1]), "offset is [1], not two numbers"),
        (transformed(scale=["a", 1]), "scale[0] is 'a', not a number"),
        (transformed(rotation="left"), "rotation is 'left', not a number"),
        (transformed(texCoord=-1), "texCoord is -1, not a whole number of 0 or more"),
        (volume(1.5), "transmissionFactor 1.5 is not in 0..1"),
        ({"extensions": {"KHR_materials_volume": 3}}, "KHR_materials_volume is 3, not an object"),
        ({"extensions": []}, "extensions is [], not an object"),
        ({"extensions": {"KHR_materials_ior": {"ior": 0.5}}}, "the ior is 0.5, but must be 0, or at least 1"),
        ({"extensions": {"KHR_materials_dispersion": {"dispersion": -1}}}, "dispersion -1 is not 0 or more"),
        ({"emissiveFactor": [1, 1]}, "emissiveFactor is [1, 1], not three numbers"),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_a_wrong_value_is_refused_in_one_line(entry: Json, message: str) -> None:
    textures = [{}] if "thicknessTexture" in str(entry) and "'index': 0" in str(entry) else []
    with pytest.raises(tl.InputError) as caught:
        parsed({}, {**entry, "name": "Bad"}, textures=textures)
    assert f"material 1 'Bad': {message}" in str(caught.value)
    assert "\n" not in str(caught.value)


VALIDATOR = {
    "valid": (0, 0),
    "double_sided": (0, 1),
    "unknown_transmission": (0, 0),
    "custom_property": (0, 2),
    "out_of_range": (4, 1),
    "unexpected_extension": (1, 0),
}


@pytest.mark.parametrize("name", VALIDATOR)
def test_the_verdict_is_that_of_the_validator(assets: Path, name: str) -> None:
    folder = assets / "gltf_validator_khr_materials_volume"
    report = json.loads((folder / f"{name}.gltf.report.json").read_text())["issues"]
    assert (report["numErrors"], report["numWarnings"]) == VALIDATOR[name]
    if report["numErrors"]:
        with pytest.raises(tl.InputError, match="material 0") as caught:
            read_materials(folder / f"{name}.gltf")
        for message in report["messages"]:
            if message["code"] == "VALUE_NOT_IN_RANGE":
                value = message["message"].split()[1]
                assert f" {value} is not" in str(caught.value)
        return
    found = read_materials(folder / f"{name}.gltf")
    expected = [int(m["pointer"].split("/")[2]) for m in report["messages"] if m["severity"] == 1]
    # The black channels and the thin walls are warnings of ours.
    own = re.compile(r" (is|are) 0(,| and) ")
    ours = [w for m in found for w in m.warnings if not own.search(w)]
    assert len(ours) == len(expected)
    assert {m.index for m in found if any(not own.search(w) for w in m.warnings)} == set(expected)


def test_the_attenuation_answer_key(assets: Path) -> None:
    """Rows 2 to 5 of AttenuationTest show the color of row 1, whose material is a plain tint."""
    file = read_gltf(assets / "gltf" / "AttenuationTest.glb")
    materials = materials_of(file)
    columns = ("0.25", "0.50", "1.0", "1.5", "2.0")
    key = {float(c): np.power(COLOR, float(c)) for c in columns}
    seen: dict[str, int] = {"R1": 0, "R2": 0, "R4": 0, "R5": 0}
    for name, index, transform in uses(file):
        row, column = name[:2], name.rpartition("_")[2]
        material = materials[index]
        if row == "R1":
            tint = file.items("materials")[index]["pbrMetallicRoughness"]["baseColorFactor"][:3]
            np.testing.assert_allclose(tint, key[float(column)], atol=1e-9)
        elif row in ("R2", "R4", "R5"):
            thickness = material.thickness * world_length(transform)
            color = optics.transmittance(material.medium().extinction * thickness)
            np.testing.assert_allclose(color, key[float(column)], atol=1e-6, err_msg=name)
        else:
            continue
        seen[row] += 1
    assert set(seen.values()) == {5}


def test_the_attenuation_answer_key_of_the_texture(assets: Path) -> None:
    file = read_gltf(assets / "gltf" / "AttenuationTest.glb")
    material = materials_of(file)[6]
    (transform,) = [transform for _, index, transform in uses(file) if index == 6]
    levels = np.unique(thickness_map(file, material))
    expected = 2.0 * np.array([32, 64, 128, 191, 255]) / 255.0
    for thickness in expected:
        assert np.abs(levels - thickness).min() < 1e-12
    world = expected * world_length(transform)
    colors = optics.transmittance(world[:, None] * material.medium().extinction)
    np.testing.assert_allclose(colors[:, 0], [0.5611, 0.3148, 0.0991, 0.03176, 0.01], rtol=1e-3)
    np.testing.assert_allclose(colors, np.power(COLOR, expected[:, None]), atol=1e-6)


@pytest.mark.parametrize(
    "name",
    ["AttenuationTest", "TransmissionRoughnessTest", "IridescenceSuzanne", "GlassHurricaneCandleHolder"],
)
def test_third_party_files_are_read(assets: Path, name: str) -> None:
    file = read_gltf(assets / "gltf" / f"{name}.glb")
    materials = materials_of(file)
    volumes = [m for m in materials if m.has_volume]
    assert volumes
    if name == "TransmissionRoughnessTest":
        for m in volumes:
            np.testing.assert_array_equal((m.medium() or tl.Medium()).transmittance(1.0), 1.0)
    if name == "IridescenceSuzanne":
        assert {m.medium() is None for m in volumes if m.transmission == 0} == {True}
    if name == "GlassHurricaneCandleHolder":
        (glass,) = [m for m in volumes if m.has_thickness_texture]
        assert thickness_map(file, glass).max() <= 0.1
        color = glass.medium().transmittance(0.1)
        np.testing.assert_allclose(color, np.power(glass.attenuation_color, 100.0), rtol=1e-12)


# Texture transforms

#: Corners of the mesh's UVs, and the top left, top right, bottom left and bottom right of the image.
CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=float)


def test_the_example_of_the_extension_shows_the_lower_left_quadrant() -> None:
    """Turned by 90 degrees: the listing of the extension would show a part of the image that is not there."""
    transform = TextureTransform(offset=(0, 1), rotation=math.pi / 2, scale=(0.5, 0.5))
    expected = [[0, 1], [0, 0.5], [0.5, 1], [0.5, 0.5]]  # v = 1 is the bottom
    np.testing.assert_allclose(transform.apply(CORNERS), expected, atol=1e-15)


def test_the_other_example_turns_v_around() -> None:
    transform = TextureTransform(offset=(0, 1), scale=(1, -1))
    np.testing.assert_array_equal(transform.apply([[0.25, 0.25]]), [[0.25, 0.75]])


def test_scale_comes_before_rotation() -> None:
    transform = TextureTransform(rotation=math.pi / 2, scale=(4, 2))
    np.testing.assert_allclose(transform.apply([[1, 0], [0, 1]]), [[0, -4], [2, 0]], atol=1e-15)


def textured(transform: Json, pixels: list[list[int]], **sampler: int) -> tuple[GltfFile, GltfMaterial]:
    """A file whose thickness texture has these 8-bit levels in G."""
    levels = np.array(pixels, dtype=np.uint8)
    stream = io.BytesIO()
    Image.fromarray(np.stack([0 * levels + 7, levels, 0 * levels + 9], axis=-1)).save(stream, format="PNG")
    uri = "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()
    file = GltfFile(
        Path("a.gltf"),
        gltf(
            transformed(**transform),
            textures=[{"source": 0, **({"sampler": 0} if sampler else {})}],
            images=[{"uri": uri}],
            samplers=[sampler],
        ),
    )
    (material,) = materials_of(file)
    return file, material


def test_the_set_of_uvs_is_that_of_the_transform() -> None:
    assert textured({}, [[0]])[1].thickness_transform.tex_coord == 1
    assert textured({"texCoord": 2}, [[0]])[1].thickness_transform.tex_coord == 2
    assert textured({}, [[0]])[1].warnings == ()


def test_thickness_at_uvs_follows_the_transform() -> None:
    # Each texel of 2 x 2, at the middle of its quarter; a quarter turn takes (u, v) to (v, -u).
    file, material = textured({"rotation": math.pi / 2}, [[0, 51], [102, 255]])
    middles = 0.25 + 0.5 * CORNERS
    turned = {(0.25, 0.25): 102, (0.75, 0.25): 0, (0.25, 0.75): 255, (0.75, 0.75): 51}
    expected = [2.0 * turned[tuple(uv)] / 255 for uv in middles.tolist()]
    np.testing.assert_allclose(thickness_at(file, material, middles), expected, rtol=1e-12, atol=1e-15)
    assert thickness_at(file, material, middles.reshape(2, 2, 2)).shape == (2, 2)


def test_between_texels_it_is_linear_or_the_nearest() -> None:
    at = [[0.5, 0.5], [0.35, 0.5]]
    file, material = textured({}, [[0, 255]])
    np.testing.assert_allclose(thickness_at(file, material, at), [1.0, 0.4], rtol=1e-12)
    file, material = textured({}, [[0, 255]], magFilter=9728)
    np.testing.assert_array_equal(thickness_at(file, material, at)[1], 0.0)


@pytest.mark.parametrize(("wrap", "expected"), [(10497, [0, 1, 2]), (33071, [2, 2, 2]), (33648, [2, 1, 0])])
def test_outside_it_wraps_as_the_sampler_says(wrap: int, expected: list[int]) -> None:
    file, material = textured({}, [[0, 51, 102]], wrapS=wrap, wrapT=33071)
    found = thickness_at(file, material, [[(i + 0.5) / 3 + 1, 9.0] for i in range(3)])
    np.testing.assert_allclose(found, np.array(expected) * 2.0 * 51 / 255, rtol=1e-12, atol=1e-15)


def test_without_a_texture_the_thickness_is_the_same_everywhere() -> None:
    (material,) = parsed(volume(thicknessFactor=2.0))
    np.testing.assert_array_equal(thickness_at(GltfFile(Path("a.gltf"), gltf()), material, CORNERS), 2.0)
    for uv in ([[0.0, math.nan]], [0.0, 1.0, 2.0], 3.0):
        with pytest.raises(tl.InputError, match=r"texture coordinates must be finite pairs \(\.\.\., 2\)"):
            thickness_at(GltfFile(Path("a.gltf"), gltf()), material, uv)


def test_an_extension_of_the_texture_that_is_not_known_is_a_warning() -> None:
    entry = transformed()
    entry["extensions"]["KHR_materials_volume"]["thicknessTexture"]["extensions"] = {"VENDOR_blur": {}}
    (found,) = parsed(entry, textures=[{}])
    assert found.warnings == ("thicknessTexture has VENDOR_blur, which is not read",)


# Transforms


def test_nodes_are_transformed_by_their_parents() -> None:
    turn = [0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4)]
    file = GltfFile(
        Path("a.gltf"),
        gltf(
            {},
            nodes=[
                {"children": [1], "scale": [2, 2, 2], "rotation": turn},
                {"mesh": 0, "name": "child", "translation": [1, 0, 0]},
            ],
            meshes=[{"primitives": [{"attributes": {}, "material": 0}]}],
        ),
    )
    np.testing.assert_allclose(node_transforms(file)[1] @ (0, 0, 0, 1), (0, 2, 0, 1), atol=1e-12)


@pytest.mark.parametrize(
    ("nodes", "message"),
    [
        ([{"children": [0]}], "their own ancestors"),
        ([{"children": [1, 1]}, {}], "two parents"),
        ([{"children": [7]}], "nodes 7 does not exist: the file has 1"),
        ([{"scale": [1, 2]}], "no valid transform"),
    ],
)
def test_bad_nodes_are_refused(nodes: list[Json], message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        node_transforms(GltfFile(Path("a.gltf"), gltf({}, nodes=nodes)))
