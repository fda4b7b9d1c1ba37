"""Surfaces and textures of glTF materials: what is read, where it is sampled, and what is refused."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import translucent as tl
from translucent.formulas.color import srgb_to_linear
from translucent.gltf import textures as images
from translucent.gltf.textures import TextureTransform
from translucent.gltf.textures import sample as sample_gltf

Json = dict[str, Any]
DIFFUSE = "KHR_materials_diffuse_transmission"
POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype="<f4")
UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype="<f4")
FACES = np.array([0, 1, 2, 0, 2, 3], dtype="<u2")
#: 4 x 3 pixels, all different.
PICTURE = np.arange(48, dtype=np.uint8).reshape(3, 4, 4) * 5


def data_uri(data: bytes, kind: str = "application/octet-stream") -> str:
    return f"data:{kind};base64," + base64.b64encode(data).decode()


def png(pixels: Any, form: str = "PNG", **options: Any) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.asarray(pixels)).save(buffer, form, **options)
    return buffer.getvalue()


def plate(
    tmp_path: Path,
    material: Json,
    picture: bytes | None = None,
    *,
    uv: bool = True,
    image: Json | None = None,
    **tree: Any,
) -> Path:
    """A file with a square of one material, and up to one picture, which texture 0 has."""
    parts = [POINTS.tobytes(), UVS.tobytes(), FACES.tobytes(), picture or b""]
    starts = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).tolist()
    content: Json = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": starts[-1], "uri": data_uri(b"".join(parts))}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(part)}
            for start, part in zip(starts, parts, strict=False)
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0} | ({"TEXCOORD_0": 1} if uv else {}), "indices": 2, "material": 0}
                ]
            }
        ],
        "nodes": [{"mesh": 0, "name": "Plate"}],
        "materials": [{"name": "Stuff", **material}],
    }
    if picture is not None or image is not None:
        content["images"] = [image or {"bufferView": 3, "mimeType": "image/png"}]
        content["textures"] = [{"source": 0}]
    path = tmp_path / "plate.gltf"
    path.write_text(json.dumps(content | tree))
    return path


def surface(path: Path) -> tl.Surface:
    (item,) = tl.load_scene(path).objects
    assert item.surface is not None
    return item.surface


def base_color(**info: Any) -> Json:
    return {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **info}}}


def test_an_opaque_object_has_all_that_its_material_says(tmp_path: Path) -> None:
    material = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.8],
            "metallicFactor": 0.25,
            "roughnessFactor": 0.75,
            "metallicRoughnessTexture": {"index": 0},
        },
        "emissiveFactor": [0.5, 1.0, 0.0],
        "emissiveTexture": {"index": 0},
        "normalTexture": {"index": 0},
        "alphaMode": "MASK",
        "alphaCutoff": 0.4,
        "doubleSided": True,
        "extensions": {
            "KHR_materials_ior": {"ior": 2.0},
            "KHR_materials_emissive_strength": {"emissiveStrength": 4.0},
            DIFFUSE: {"diffuseTransmissionFactor": 0.5, "diffuseTransmissionColorFactor": [1, 0.5, 0.25]},
            "KHR_materials_iridescence": {
                "iridescenceFactor": 0.5,
                "iridescenceIor": 1.8,
                "iridescenceThicknessMaximum": 250,
            },
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.75, "clearcoatRoughnessFactor": 0.125},
        },
    }
    path = plate(tmp_path, material, png(PICTURE))
    (item,) = tl.load_scene(path).objects
    found = item.surface
    assert (item.medium, item.has_interface) == (None, False)
    assert (found.metallic, found.roughness, found.ior, found.diffuse_transmission) == (0.25, 0.75, 2.0, 0.5)
    assert np.asarray(item.base_color).tolist() == [0.1, 0.2, 0.3]
    assert np.asarray(found.emissive).tolist() == [2.0, 4.0, 0.0]
    assert np.asarray(found.diffuse_transmission_color).tolist() == [1.0, 0.5, 0.25]
    assert (found.iridescence, found.iridescence_ior) == (0.5, 1.8)
    assert found.iridescence_thickness == pytest.approx(250e-9)
    assert (found.clearcoat, found.clearcoat_roughness) == (0.75, 0.125)
    assert (found.alpha_cutoff, found.double_sided) == (0.5, True)  # of the texture's own opacity
    # The same picture as numbers is one texture; as encoded colors, another.
    assert found.roughness_texture is found.normal_texture
    assert found.emissive_texture is not found.normal_texture
    assert found.color_texture is None


def test_factors_that_are_not_stated_have_the_defaults_of_gltf(tmp_path: Path) -> None:
    found = surface(plate(tmp_path, {}))
    assert (found.metallic, found.roughness, found.ior, found.alpha_cutoff, found.double_sided) == (1, 1, 1.5, 0, False)
    assert (found.iridescence, found.iridescence_ior, found.clearcoat, found.clearcoat_roughness) == (0, 1.3, 0, 0)


def test_a_body_has_tint_roughness_dispersion_and_share_of_transmission(tmp_path: Path) -> None:
    extensions = {
        "KHR_materials_transmission": {"transmissionFactor": 0.75, "transmissionTexture": {"index": 0}},
        "KHR_materials_volume": {"thicknessFactor": 1.0, "thicknessTexture": {"index": 0}},
        "KHR_materials_dispersion": {"dispersion": 0.3},
    }
    base = {"baseColorFactor": [0.5, 1.0, 1.0, 1.0], "roughnessFactor": 0.25, "metallicFactor": 0.0}
    path = plate(tmp_path, {"extensions": extensions, "pbrMetallicRoughness": base}, png(PICTURE))
    scene = tl.load_scene(path)
    (body,) = scene.objects
    assert body.medium.ior == 1.5
    assert (body.surface.roughness, body.surface.dispersion, body.surface.transmission) == (0.25, 0.3, 0.75)
    assert np.asarray(body.surface.color).tolist() == [0.5, 1.0, 1.0]
    assert body.surface.transmission_texture is not None
    assert scene.left_out == ()


def test_a_wall_that_transmits_a_share_has_its_tint_on_the_surface(tmp_path: Path) -> None:
    base = {"baseColorFactor": [0.5, 0.25, 1.0, 1.0]}
    for share, inside in ((1.0, [0.5, 0.25, 1.0]), (0.5, [1.0, 1.0, 1.0])):
        extensions = {"KHR_materials_transmission": {"transmissionFactor": share}}
        (wall,) = tl.load_scene(plate(tmp_path, {"extensions": extensions, "pbrMetallicRoughness": base})).objects
        np.testing.assert_allclose(wall.medium.transmittance(wall.sheet_thickness), inside, rtol=1e-12)
        both = np.asarray(wall.surface.color) * wall.medium.transmittance(wall.sheet_thickness)
        np.testing.assert_allclose(both, [0.5, 0.25, 1.0], rtol=1e-12)


def test_light_that_a_volume_lets_in_diffusely_makes_a_body(tmp_path: Path) -> None:
    volume = {"thicknessFactor": 1.0, "attenuationColor": [0.5, 0.5, 0.5], "attenuationDistance": 1.0}
    extensions = {"KHR_materials_volume": volume, DIFFUSE: {"diffuseTransmissionFactor": 0.6}}
    (body,) = tl.load_scene(plate(tmp_path, {"extensions": extensions})).objects
    assert body.medium is not None
    assert (body.surface.transmission, body.surface.diffuse_transmission) == (0.0, 0.6)


def test_an_unlit_object_glows_in_its_base_color_and_mirrors_nothing(tmp_path: Path) -> None:
    material = {
        "extensions": {"KHR_materials_unlit": {}},
        "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1]},
    }
    found = surface(plate(tmp_path, material))
    assert np.asarray(found.emissive).tolist() == [0.2, 0.4, 0.6]
    assert (np.asarray(found.color).tolist(), found.ior, found.metallic) == ([0, 0, 0], 1.0, 0.0)


@pytest.mark.parametrize("stored", ["buffer view", "data URI", "file", "file with %20"])
def test_a_picture_may_be_anywhere_and_is_decoded(tmp_path: Path, stored: str) -> None:
    data, name = png(PICTURE), "two words.png"
    (tmp_path / name).write_bytes(data)
    image = {
        "buffer view": None,
        "data URI": {"uri": data_uri(data, "image/png")},
        "file": {"uri": name},
        "file with %20": {"uri": "two%20words.png"},
    }[stored]
    picture = data if stored == "buffer view" else None
    found = surface(plate(tmp_path, base_color(), picture, image=image)).color_texture
    assert found is not None
    np.testing.assert_allclose(found.pixels[..., :3], srgb_to_linear(PICTURE[..., :3] / 255), atol=1e-7)
    np.testing.assert_allclose(found.pixels[..., 3], PICTURE[..., 3] / 255, atol=1e-7)


@pytest.mark.parametrize("kind", ["RGB", "L", "LA", "P", "16 bits", "JPEG"])
def test_pictures_of_all_kinds_are_read(tmp_path: Path, kind: str) -> None:
    gray = np.array([[0, 51], [102, 255]], dtype=np.uint8)
    if kind == "16 bits":
        data = png(gray.astype(np.uint16) * 257)
    elif kind == "JPEG":
        data = png(np.kron(gray, np.ones((8, 8), np.uint8)), "JPEG", quality=95)
    else:
        buffer = io.BytesIO()
        Image.fromarray(gray).convert(kind).save(buffer, "PNG")
        data = buffer.getvalue()
    material = {"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}
    found = surface(plate(tmp_path, material, data)).roughness_texture
    assert found is not None
    expected = np.kron(gray, np.ones((8, 8))) if kind == "JPEG" else gray
    # A JPEG of flat blocks of 8 x 8 has only their rounded means.
    np.testing.assert_allclose(found.pixels[..., 1] * 255, expected, atol=1.0 if kind == "JPEG" else 1e-4)


@pytest.mark.parametrize("rotation", [0.0, 0.5, -2.0])
@pytest.mark.parametrize("wrap_s", [10497, 33071, 33648])
@pytest.mark.parametrize("wrap_t", [10497, 33071, 33648])
def test_a_texture_is_where_its_transform_and_its_sampler_put_it(
    tmp_path: Path, rng: np.random.Generator, rotation: float, wrap_s: int, wrap_t: int
) -> None:
    stated = {"offset": [0.3, -0.2], "rotation": rotation, "scale": [1.5, -0.7]}
    texture = base_color(extensions={"KHR_texture_transform": stated})
    sampler = {"wrapS": wrap_s, "wrapT": wrap_t}
    textures = {"samplers": [sampler], "textures": [{"source": 0, "sampler": 0}]}
    found = surface(plate(tmp_path, texture, png(PICTURE), **textures)).color_texture
    assert found is not None
    at = rng.uniform(-0.2, 1.2, (200, 2))
    if "clamp" in (*found.wrap,) and {wrap_s, wrap_t} == {33071, 33648}:
        at = rng.uniform(0.0, 0.4, (200, 2))
    transformed = TextureTransform((0.3, -0.2), rotation, (1.5, -0.7)).apply(at)
    expected = sample_gltf(srgb_to_linear(PICTURE[..., 1] / 255), transformed, sampler)
    upwards = np.column_stack([at[:, 0], 1.0 - at[:, 1]])
    np.testing.assert_allclose(found.sample(upwards)[:, 1], expected, atol=1e-6)


def test_a_steeper_normal_map_has_unit_normals(tmp_path: Path) -> None:
    flat, slanted = (128, 128, 255), (128 + 76, 128, 128 + 102)  # (0.6, 0, 0.8), to half a level
    picture = np.array([[flat, slanted]], dtype=np.uint8)
    normals = []
    for scale in (1.0, 2.0, 0.0):
        material = {"normalTexture": {"index": 0, "scale": scale}}
        texture = surface(plate(tmp_path, material, png(picture))).normal_texture
        assert texture is not None
        normals.append(2.0 * texture.pixels[0, :, :3].astype(np.float64) - 1.0)
    np.testing.assert_allclose(normals[0][1], (0.6, 0.0, 0.8), atol=0.01)
    np.testing.assert_allclose(normals[1][1], np.array([1.2, 0.0, 0.8]) / np.hypot(1.2, 0.8), atol=0.01)
    np.testing.assert_allclose(normals[2], np.tile([0.0, 0.0, 1.0], (2, 1)), atol=1e-6)


@pytest.mark.parametrize(
    ("material", "tree", "line"),
    [
        (base_color(texCoord=1), {}, "textures with TEXCOORD_1 ('Stuff')"),
        (base_color(extensions={"KHR_texture_transform": {"texCoord": 2}}), {}, "textures with TEXCOORD_2 ('Stuff')"),
        (
            base_color(),
            {"textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]},
            "textures that are neither PNG nor JPEG ('Stuff')",
        ),
    ],
)
def test_what_is_not_read_of_textures_is_told(tmp_path: Path, material: Json, tree: Json, line: str) -> None:
    path = plate(tmp_path, material, png(PICTURE), **tree)
    with pytest.warns(tl.TranslucentWarning, match="left out"):
        scene = tl.load_scene(path)
    assert scene.left_out == (line,)
    assert scene.objects[0].surface.color_texture is None


def test_filters_without_interpolation_are_told(tmp_path: Path) -> None:
    sampled = {"samplers": [{"magFilter": 9728}], "textures": [{"source": 0, "sampler": 0}]}
    path = plate(tmp_path, base_color(), png(PICTURE), **sampled)
    with pytest.warns(tl.TranslucentWarning, match="nearest-neighbor filtering"):
        assert tl.load_scene(path).objects[0].surface.color_texture is not None


def test_a_mesh_without_texture_coordinates_keeps_the_factors(tmp_path: Path) -> None:
    path = plate(tmp_path, base_color(), png(PICTURE), uv=False)
    with pytest.warns(tl.TranslucentWarning, match=r"textures of meshes without TEXCOORD_0 \('Plate'\)"):
        (item,) = tl.load_scene(path).objects
    assert not any(item.surface.textures)


def test_large_pictures_are_made_smaller_and_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images, "MAX_SIDE", 8)
    path = plate(tmp_path, base_color(), png(np.full((32, 16, 3), 77, np.uint8)))
    with pytest.warns(tl.TranslucentWarning, match="full resolution of textures larger than 8 pixels along a side"):
        found = tl.load_scene(path).objects[0].surface.color_texture
    assert found.pixels.shape == (8, 4, 4)
    np.testing.assert_allclose(found.pixels[..., :3], srgb_to_linear(77 / 255), atol=1e-7)


def test_metal_on_glass_is_told_where_the_mesh_has_it(tmp_path: Path) -> None:
    glass = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
    for blue, told in ((0, False), (255, True)):
        picture = np.full((2, 2, 3), (0, 128, blue), np.uint8)
        rough = {"metallicRoughnessTexture": {"index": 0}}
        path = plate(tmp_path, {"extensions": glass, "pbrMetallicRoughness": rough}, png(picture))
        if told:
            with pytest.warns(tl.TranslucentWarning, match=r"metal parts of translucent objects \('Plate'\)"):
                tl.load_scene(path)
        else:
            assert tl.load_scene(path).left_out == ()


def test_what_its_alpha_hides_is_left_out(tmp_path: Path) -> None:
    hidden = {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0.4]}}
    path = plate(tmp_path, hidden)
    tree = json.loads(path.read_text())
    tree["materials"].append({})
    tree["meshes"].append({"primitives": [tree["meshes"][0]["primitives"][0] | {"material": 1}]})
    tree["nodes"].append({"mesh": 1, "name": "Seen"})
    path.write_text(json.dumps(tree))
    with pytest.warns(tl.TranslucentWarning, match=r"objects with an alpha of 0 \('Plate'\)"):
        assert [item.mesh.name for item in tl.load_scene(path).objects] == ["Seen"]


@pytest.mark.parametrize(
    ("material", "picture", "message"),
    [
        (
            {"pbrMetallicRoughness": {"roughnessFactor": 1.5}},
            None,
            "material 'Stuff': roughnessFactor 1.5 is not in 0..1",
        ),
        ({"pbrMetallicRoughness": {"metallicFactor": -1}}, None, "metallicFactor -1 is not in 0..1"),
        ({"extensions": {"KHR_materials_ior": {"ior": 0.5}}}, None, "the ior is 0.5, but must be 0, or at least 1"),
        (
            {"extensions": {DIFFUSE: {"diffuseTransmissionFactor": 2}}},
            None,
            "diffuseTransmissionFactor 2 is not in 0..1",
        ),
        ({"alphaMode": "FOG"}, None, "alphaMode 'FOG' is not defined in glTF"),
        ({"doubleSided": 1}, None, "doubleSided is 1, not true or false"),
        (base_color(), None, "textures 0 does not exist: the file has 0"),
        (base_color(index=3), b"", "textures 3 does not exist: the file has 1"),
        (base_color(texCoord=-1), b"", "texCoord is -1, not a whole number"),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_a_bad_material_is_refused_in_words(
    tmp_path: Path, material: Json, picture: bytes | None, message: str
) -> None:
    with pytest.raises(tl.InputError, match=message) as caught:
        tl.load_scene(plate(tmp_path, material, picture))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("picture", "image", "named"),
    [
        (None, {"uri": "wood.png"}, "'wood.png'"),
        (None, {"uri": "data:image/png;base64,!"}, "image number 0"),
        (b"GIF89a no picture", None, "image number 0"),
        (png(PICTURE)[:-30], None, "image number 0"),
        (b"", None, "image number 0"),
    ],
    ids=["missing", "no base64", "another kind", "cut short", "empty"],
)
def test_of_a_picture_that_is_missing_or_broken_the_factors_are_left(
    tmp_path: Path, picture: bytes | None, image: Json | None, named: str
) -> None:
    color = {"baseColorFactor": [0.1, 0.2, 0.3, 1.0], "baseColorTexture": {"index": 0}}
    path = plate(tmp_path, {"pbrMetallicRoughness": color, "emissiveTexture": {"index": 0}}, picture, image=image)
    with pytest.warns(tl.TranslucentWarning, match="textures that are missing or broken") as caught:
        scene = tl.load_scene(path)
    assert len(caught) == 1
    assert scene.left_out == (f"textures that are missing or broken ({named} of material 'Stuff')",)
    found = scene.objects[0].surface
    assert (found.color_texture, np.asarray(found.color).tolist()) == (None, [0.1, 0.2, 0.3])


def test_a_picture_in_a_missing_buffer_is_an_error(tmp_path: Path) -> None:
    path = plate(tmp_path, base_color(), png(PICTURE))
    tree = json.loads(path.read_text())
    tree["buffers"].append({"byteLength": 9, "uri": "gone.bin"})
    tree["bufferViews"][3]["buffer"] = 1
    path.write_text(json.dumps(tree))
    with pytest.raises(tl.InputError, match=r"'gone.bin' cannot be read .*keep all files of the model together"):
        tl.load_scene(path)


def test_a_picture_beyond_all_measure_is_refused(tmp_path: Path) -> None:
    black = png(np.zeros((7000, 7000), np.uint8))
    with pytest.raises(tl.InputError, match=r"7000x7000 pixels take 561 MiB; the limit .* is 512 MiB; use a sm"):
        tl.load_scene(plate(tmp_path, base_color(), black))


def test_files_with_materials_are_lit_by_the_studio_and_others_as_ever(tmp_path: Path) -> None:
    path = plate(tmp_path, {})
    assert tl.load_scene(path).environment.kind == "image"
    tree = json.loads(path.read_text())
    del tree["meshes"][0]["primitives"][0]["material"]
    path.write_text(json.dumps(tree))
    scene = tl.load_scene(path)
    assert (scene.environment.kind, scene.objects[0].surface) == ("gradient", None)
