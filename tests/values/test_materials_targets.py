"""Media in the terms of other systems, there and back, and where those terms are known to mislead."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import translucent as tl
from translucent.materials import TARGETS, load_medium, text_block
from translucent.materials.blender import (
    absorption_node,
    blender_snippet,
    from_absorption_node,
    from_principled_node,
    principled_node,
)
from translucent.materials.color_distance import BLACKEST, color_at, extinction_at
from translucent.materials.gltf import materials_of
from translucent.materials.gltf_file import GltfFile
from translucent.materials.json_text import read_json, write_json
from translucent.materials.openpbr import read_openpbr, write_openpbr
from translucent.materials.standard_surface import read_standard_surface, write_standard_surface
from translucent.materials.unity import from_unity
from translucent.materials.unreal import LONGEST_CM, from_mean_free_path_cm, mean_free_path_cm
from translucent.materials.usd import read_usda, usda_text

COLOR = (0.18, 0.62, 0.35)
JADE = tl.Medium.from_color(COLOR, distance=0.02, ior=1.6)
MILK = tl.Medium(absorption=(1.4, 2.5, 14.2), scattering=(700, 1220, 1900), anisotropy=0.25, ior=1.3)
GLOW = tl.Medium(absorption=(1, 2, 3), scattering=(3, 0, 1), emission=(0.5, 2, 0), anisotropy=-0.4)
CLEAR = tl.Medium(ior=1.33)

sigma = st.floats(0, 1e4).map(lambda v: 0.0 if v < 1e-6 else v)
triples = st.tuples(sigma, sigma, sigma)


def close(found: tl.Medium, expected: tl.Medium, rtol: float = 1e-12) -> None:
    scale = float(expected.extinction.max())
    for field in ("absorption", "scattering"):
        np.testing.assert_allclose(getattr(found, field), getattr(expected, field), rtol=0, atol=rtol * scale)


# Color at a distance


def test_the_color_is_the_one_that_the_medium_was_made_of() -> None:
    color, distance = color_at(JADE, 0.02)
    assert (tuple(color), distance) == (COLOR, 0.02)


def test_without_a_distance_the_densest_channel_lets_1_e_pass() -> None:
    color, distance = color_at(tl.Medium(absorption=(1, 2, 4)))
    assert distance == 0.25
    np.testing.assert_allclose(color, np.exp([-0.25, -0.5, -1.0]), rtol=1e-14)


def test_too_dark_a_color_is_stated_nearer() -> None:
    color, distance = color_at(MILK, 1.0)
    assert color.min() > BLACKEST
    np.testing.assert_allclose(extinction_at(color, distance), MILK.extinction, rtol=1e-14)


def test_a_clear_medium_is_white() -> None:
    color, distance = color_at(CLEAR)
    assert math.isinf(distance)
    np.testing.assert_array_equal(extinction_at(color, distance), 0.0)


def test_black_has_a_finite_extinction() -> None:
    np.testing.assert_allclose(extinction_at((0, 1, 1), 2.0), (-math.log(BLACKEST) / 2, 0, 0), rtol=1e-15)


# MaterialX


@pytest.mark.parametrize("surface", [(write_openpbr, read_openpbr), (write_standard_surface, read_standard_surface)])
class TestMaterialX:
    @pytest.mark.parametrize("medium", [JADE, MILK, CLEAR], ids=["jade", "milk", "clear"])
    @pytest.mark.parametrize("distance", [None, 0.02, 10.0])
    @pytest.mark.parametrize("unit", ["m", "cm"])
    def test_there_and_back(self, surface: Any, medium: tl.Medium, distance: float | None, unit: str) -> None:
        write, read = surface
        found = read(write(medium, distance, unit=unit), unit=unit)
        close(found, medium)
        assert found.ior == medium.ior
        assert found.anisotropy == medium.anisotropy

    def test_the_scatter_color_is_at_most_1(self, surface: Any) -> None:
        text = surface[0](tl.Medium(absorption=0.5, scattering=(2, 3, 4)), 1.0)
        (color,) = re.findall('transmission_scatter" type="color3" value="([^"]*)"', text)
        assert max(float(channel) for channel in color.split(",")) <= 1

    def test_the_depth_is_in_scene_units(self, surface: Any) -> None:
        write, read = surface
        text = write(JADE, 0.02, unit="cm")
        assert 'name="transmission_depth" type="float" value="2.0"' in text
        assert 'name="transmission_color" type="color3" value="0.18, 0.62, 0.35"' in text
        np.testing.assert_allclose(read(text, unit="mm").extinction, JADE.extinction * 10, rtol=1e-12)

    def test_more_scattering_than_extinction_is_shifted_by_grey(self, surface: Any) -> None:
        write, read = surface
        text = write(tl.Medium(absorption=1.0), 1.0)
        text = re.sub('(transmission_color" type="color3" value)="[^"]*"', r'\1="1, 0.5, 0.25"', text)
        text = re.sub('(transmission_scatter" type="color3" value)="[^"]*"', r'\1="0.5, 0.5, 0"', text)
        found = read(text)
        np.testing.assert_allclose(found.scattering, (0.5, 0.5, 0))
        np.testing.assert_allclose(found.absorption, (0, math.log(2), math.log(4) + 0.5), rtol=1e-12)

    def test_white_without_scattering_is_no_0_by_0(self, surface: Any) -> None:
        write, read = surface
        text = write(tl.Medium(absorption=1.0), 1.0)
        text = re.sub('(transmission_color" type="color3" value)="[^"]*"', r'\1="1, 1, 1"', text)
        assert read(text) == tl.Medium()

    def test_an_srgb_color_is_made_linear(self, surface: Any) -> None:
        write, read = surface
        text = write(JADE, 0.02).replace('"lin_rec709"', '"srgb_texture"')
        np.testing.assert_allclose(read(text).transmittance(0.02), tl.color.srgb_to_linear(COLOR), rtol=1e-12)

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ("</materialx>", "", "XML is broken"),
            ('type="color3" value="0.18, 0.62, 0.35"', 'type="color3" value="0.18, 0.62"', "not three numbers"),
            ('type="color3" value="0.18, 0.62, 0.35"', 'type="color3" nodename="x"', "comes from a node"),
            ('value="0.02"', 'value="deep"', "not a number"),
            ('value="0.02"', 'value="-1"', "negative depth"),
            ("0.18, 0.62, 0.35", "1.18, 0.62, 0.35", "outside 0..1"),
            ("lin_rec709", "acescg", "color space 'acescg'"),
        ],
    )
    def test_a_bad_document_is_refused_in_one_line(self, surface: Any, old: str, new: str, message: str) -> None:
        write, read = surface
        text = write(JADE, 0.02)
        assert old in text
        with pytest.raises(tl.InputError, match=message) as caught:
            read(text.replace(old, new))
        assert "\n" not in str(caught.value)

    def test_another_surface_is_refused(self, surface: Any) -> None:
        other = write_openpbr if surface[0] is write_standard_surface else write_standard_surface
        with pytest.raises(tl.InputError, match="it has no <"):
            surface[1](other(JADE))

    def test_materialx_accepts_the_document(self, surface: Any) -> None:
        mx = pytest.importorskip("MaterialX", reason="the materialx package is absent")
        library = mx.createDocument()
        mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
        for medium in (JADE, MILK, CLEAR):
            document = mx.createDocument()
            mx.readFromXmlString(document, surface[0](medium, 0.02))
            document.setDataLibrary(library)
            valid, message = document.validate()
            assert valid, message
            (shader,) = [n for n in document.getNodes() if n.getType() == "surfaceshader"]
            assert shader.getNodeDef() is not None
            known = {i.getName(): i.getType() for i in shader.getNodeDef().getActiveInputs()}
            for item in shader.getInputs():
                assert known[item.getName()] == item.getType()


# Blender


def test_blender_absorption_is_no_color_at_a_distance() -> None:
    medium = from_absorption_node((0.5, 0.5, 0.5), 1.0)
    np.testing.assert_allclose(medium.extinction, 0.5)  # and not ln 2 = 0.693
    color, density = absorption_node(tl.Medium.from_color((0.5, 0.5, 0.5), 1.0))
    np.testing.assert_allclose((1.0 - color) * density, math.log(2), rtol=1e-15)


@given(triples)
def test_blender_absorption_there_and_back(absorption: tuple[float, float, float]) -> None:
    medium = tl.Medium(absorption=absorption)
    color, density = absorption_node(medium)
    assert ((color >= 0) & (color <= 1)).all()
    close(from_absorption_node(color, density), medium, 1e-15)


@given(triples, triples)
def test_blender_principled_there_and_back(
    absorption: tuple[float, float, float], scattering: tuple[float, float, float]
) -> None:
    medium = tl.Medium(absorption=absorption, scattering=scattering)
    with np.errstate(under="ignore"):
        color, absorb, density = principled_node(medium)
        assert ((color >= 0) & (color <= 1) & (absorb >= 0) & (absorb <= 1)).all()
        close(from_principled_node(color, absorb, density), medium, 1e-12)


def test_blender_values_out_of_range_are_refused() -> None:
    with pytest.raises(tl.InputError, match=r"not three numbers in 0\.\.1"):
        from_absorption_node((1.5, 0, 0), 1.0)
    with pytest.raises(tl.InputError, match="Density"):
        from_absorption_node((0.5, 0, 0), -1.0)


@pytest.mark.parametrize("version", [4, 5])
@pytest.mark.parametrize("medium", [JADE, MILK, GLOW, CLEAR], ids=["jade", "milk", "glow", "clear"])
def test_the_blender_snippet_runs_and_sets_the_sockets(
    medium: tl.Medium, version: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: dict[str, Any] = {}

    class Sockets(dict[str, Any]):
        def __missing__(self, key: str) -> Any:
            return self.setdefault(key, SimpleNamespace(default_value=None))

    def new(kind: str) -> Any:
        return made.setdefault(kind, SimpleNamespace(inputs=Sockets(), outputs=Sockets()))

    tree = SimpleNamespace(
        nodes=SimpleNamespace(new=new, clear=made.clear),
        links=SimpleNamespace(new=lambda a, b: made.update(link=(a, b))),
    )

    class Material:
        """Up to version 4 it has no nodes until it is told to use them; from 5 on, telling it is deprecated."""

        node_tree = tree if version == 5 else None

        def __setattr__(self, key: str, value: Any) -> None:
            assert (version, key, value) == (4, "use_nodes", True)
            Material.node_tree = tree

    bpy = SimpleNamespace(data=SimpleNamespace(materials=SimpleNamespace(new=lambda name: Material())))
    monkeypatch.setitem(__import__("sys").modules, "bpy", bpy)
    exec(compile(blender_snippet(medium), "snippet", "exec"), {})
    absorbing = "ShaderNodeVolumeAbsorption" in made
    volume = made["ShaderNodeVolumeAbsorption" if absorbing else "ShaderNodeVolumePrincipled"]
    values = {key: socket.default_value for key, socket in volume.inputs.items()}
    if absorbing:
        found = from_absorption_node(values["Color"][:3], values["Density"])
    else:
        found = from_principled_node(
            values["Color"][:3], values["Absorption Color"][:3], values["Density"], values["Anisotropy"]
        )
        assert found.anisotropy == medium.anisotropy
        q = values["Emission Strength"] * np.array(values["Emission Color"][:3])
        np.testing.assert_allclose(q, medium.emission, rtol=1e-15)
    close(found, medium)
    assert "link" in made


# Game engines


def test_unreal_is_in_centimeters() -> None:
    # -t / ln(T) at t = 2 cm.
    np.testing.assert_allclose(mean_free_path_cm(JADE), -2.0 / np.log(COLOR), rtol=1e-14)
    np.testing.assert_allclose(from_mean_free_path_cm(mean_free_path_cm(JADE)).extinction, JADE.extinction, rtol=1e-14)


def test_unreal_without_extinction() -> None:
    path = mean_free_path_cm(tl.Medium(absorption=(0, 1, 2)))
    np.testing.assert_array_equal(path, [math.inf, 100, 50])
    np.testing.assert_array_equal(from_mean_free_path_cm(path).extinction, [0, 1, 2])
    text = text_block("unreal", CLEAR, (1, 1, 1), 0.02)
    assert f"{LONGEST_CM:.9g}" in text
    assert "inf" not in text
    with pytest.raises(tl.InputError, match="above 0"):
        from_mean_free_path_cm((0, 1, 1))


def test_unity_color_is_srgb() -> None:
    text = text_block("unity", JADE, COLOR, 0.02)
    comment, *lines = text.splitlines()
    assert comment.startswith("// HDRP/Lit, with Surface Type: Transparent")
    color = [float(v) for v in re.findall(r"([\d.e-]+)f", lines[0])]
    distance, ior = (float(re.findall(r", ([\d.e-]+)f", line)[0]) for line in lines[1:])
    np.testing.assert_allclose(from_unity(color, distance, ior).extinction, JADE.extinction, rtol=1e-7)
    assert (distance, ior) == (0.02, 1.6)


def test_unity_names_its_properties_and_its_formula_gives_our_extinction() -> None:
    """The formula of its shader library adds the smallest step of float32 to the color before the logarithm."""
    for color in (COLOR, (1.5e-5, 0.5, 1.0)):
        medium = tl.Medium.from_color(color, 0.02)
        lines = text_block("unity", medium, color, 0.02).splitlines()[1:]
        names = ("_TransmittanceColor", "_ATDistance", "_Ior")
        assert [re.findall(r'Set(Color|Float)\("(\w+)"', line)[0][1] for line in lines] == list(names)
        encoded = np.array([float(v) for v in re.findall(r"([\d.e-]+)f", lines[0])])
        linear = tl.color.srgb_to_linear(encoded)
        theirs = -np.log(linear + 2.0**-24) / 0.02
        # log(1 + e / t) <= e / t, and nine digits of the encoded color.
        assert (np.abs(theirs - medium.extinction) * 0.02 <= 2.0**-24 / linear + 1e-8).all()


# All blocks


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("medium", [JADE, MILK, GLOW, CLEAR], ids=["jade", "milk", "glow", "clear"])
@pytest.mark.parametrize("distance", [1e-6, 0.02, 1e4])
def test_every_target_writes_finite_numbers(target: str, medium: tl.Medium, distance: float) -> None:
    with np.errstate(under="raise"):
        text = text_block(target, medium, medium.transmittance(distance), distance)
    assert text
    assert not text.endswith("\n")
    assert not re.search(r"\b(nan|inf|infinity)\b", text, re.IGNORECASE)
    assert "np." not in text


def test_an_unknown_target_names_the_known_ones() -> None:
    with pytest.raises(tl.InputError) as caught:
        text_block("maya", JADE, COLOR, 0.02)
    for name in ("gltf", "openpbr", "standard_surface", "blender", "unreal", "unity", "usd", "css", "json"):
        assert name in str(caught.value)
        assert name in TARGETS


@pytest.mark.parametrize("distance", [0.0, -1.0, math.inf, math.nan])
def test_a_distance_that_is_none_is_refused(distance: float) -> None:
    with pytest.raises(tl.InputError, match="not above 0 and finite"):
        text_block("gltf", JADE, COLOR, distance)


def test_a_color_of_another_medium_is_refused() -> None:
    with pytest.raises(tl.InputError, match="the medium has"):
        text_block("gltf", JADE, (0.5, 0.5, 0.5), 0.02)


def test_names_are_forgiving() -> None:
    assert text_block("Standard-Surface", JADE, COLOR, 0.02) == text_block("standard_surface", JADE, COLOR, 0.02)


@pytest.mark.parametrize("distance", [0.02, 5.0])
def test_the_gltf_block_is_a_material(distance: float) -> None:
    entry = json.loads(text_block("gltf", JADE, JADE.transmittance(distance), distance))
    tree = {"asset": {"version": "2.0"}, "materials": [entry]}
    (found,) = materials_of(GltfFile(Path("a.gltf"), tree))
    assert found.warnings == ()
    close(found.medium(), JADE)
    assert found.medium().ior == 1.6
    if distance == 0.02:
        assert found.attenuation_color == COLOR


@pytest.mark.parametrize("medium", [JADE, MILK, GLOW, CLEAR], ids=["jade", "milk", "glow", "clear"])
def test_json_holds_all_of_it(medium: tl.Medium) -> None:
    assert read_json(write_json(medium)) == medium


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "it is broken"),
        ("[]", "not an object"),
        ('{"absorbtion": 1}', "unknown absorbtion"),
        ('{"ior": "glass"}', "ior is 'glass', not a number"),
        ('{"absorption": [1, 2]}', "not one or three numbers"),
        ('{"absorption": NaN}', "not finite"),
    ],
)
def test_bad_json_is_refused(text: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        read_json(text)


def test_css_has_the_color_and_a_gradient() -> None:
    text = text_block("css", JADE, COLOR, 0.02)
    assert "color(srgb-linear 0.18 0.62 0.35)" in text
    assert re.search(r"linear-gradient\(to right, #ffffff, (#[0-9a-f]{6}, ){7}#[0-9a-f]{6}\)", text)
    assert tl.color.to_hex(COLOR) in text


def test_the_usd_layer_is_parsed_and_has_the_values() -> None:
    pxr = pytest.importorskip("pxr", reason="the usd-core package is absent")
    from pxr import Usd, UsdShade  # type: ignore[import-untyped, unused-ignore]

    assert pxr
    layer = Usd.Stage.CreateInMemory()
    assert layer.GetRootLayer().ImportFromString(text_block("usd", MILK, MILK.transmittance(1e-4), 1e-4))
    material = UsdShade.Material(layer.GetDefaultPrim())
    shader, _, _ = material.ComputeSurfaceSource("mtlx")
    assert shader.GetIdAttr().Get() == "ND_open_pbr_surface_surfaceshader"
    color, depth, scatter = (
        np.array(shader.GetInput(f"transmission_{key}").Get()) for key in ("color", "depth", "scatter")
    )
    np.testing.assert_allclose(-np.log(color) / depth, MILK.extinction, rtol=1e-5)
    np.testing.assert_allclose(scatter / depth, MILK.scattering, rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "target"),
    [("a.mtlx", "openpbr"), ("b.MTLX", "standard_surface"), ("c.usda", "usd"), ("d.json", "json")],
)
@pytest.mark.parametrize("medium", [JADE, MILK, CLEAR], ids=["jade", "milk", "clear"])
def test_files_of_other_systems_are_loaded(tmp_path: Path, name: str, target: str, medium: tl.Medium) -> None:
    (tmp_path / name).write_text(text_block(target, medium, medium.transmittance(1e-4), 1e-4))
    found = load_medium(tmp_path / name)
    close(found, medium)
    assert (found.ior, found.anisotropy) == (medium.ior, medium.anisotropy)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.glb", "", "suffix '.glb'; give a .mtlx, .usda, .json file; of glTF, translucent material show tells"),
        ("a.mtlx", "<materialx><open_pbr_surface>", "a.mtlx'; OpenPBR document; its XML is broken"),
        ("a.mtlx", "<materialx/>", "a.mtlx'; Standard Surface document; it has no <standard_surface>"),
        ("a.usda", "", "not .usda text"),
    ],
)
def test_files_that_hold_no_material_are_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(tl.InputError, match=re.escape(message)):
        load_medium(tmp_path / name)
    with pytest.raises(tl.InputError, match=r"cannot be read|suffix"):
        load_medium(tmp_path / "none" / name)


USD = text_block("usd", JADE, COLOR, 0.02)


@pytest.mark.parametrize("medium", [JADE, MILK, CLEAR], ids=["jade", "milk", "clear"])
@pytest.mark.parametrize("distance", [None, 0.02, 10.0])
def test_usd_there_and_back(medium: tl.Medium, distance: float | None) -> None:
    found = read_usda(usda_text(medium, distance))
    close(found, medium)
    assert (found.ior, found.anisotropy) == (medium.ior, medium.anisotropy)


def test_usd_lengths_are_in_the_units_of_the_layer() -> None:
    np.testing.assert_allclose(
        read_usda(USD.replace("metersPerUnit = 1", "metersPerUnit = 0.1")).extinction, JADE.extinction * 10
    )
    # A layer that states none is in centimeters.
    np.testing.assert_allclose(read_usda(USD.replace("    metersPerUnit = 1\n", "")).extinction, JADE.extinction * 100)


def test_usd_standard_surface_is_read_and_an_srgb_color_is_made_linear() -> None:
    text = USD.replace("open_pbr_surface", "standard_surface").replace("transmission_weight", "transmission")
    text = text.replace("specular_ior", "specular_IOR")
    close(read_usda(text), JADE)
    for space in ("srgb_texture", "srgb_rec709_scene"):
        encoded = USD.replace("(0.18, 0.62, 0.35)", f'(0.18, 0.62, 0.35) (\n colorSpace = "{space}"\n)')
        np.testing.assert_allclose(read_usda(encoded).transmittance(0.02), tl.color.srgb_to_linear(COLOR), rtol=1e-12)


def test_usd_signs_in_strings_comments_and_paths_mean_nothing() -> None:
    odd = """
        asset inputs:file = @a}b.png@
        rel to = </x}y>
        string inputs:single = '}"' # }
        string inputs:double = "}\\"}"
        string inputs:long = '''it's }
 "inputs:transmission_depth = 9"}''' (doc = "metersPerUnit = 9")
"""
    before = '"ND_open_pbr_surface_surfaceshader"'
    text = USD.replace(before, before + odd)
    assert text.count("}") == USD.count("}") + 8
    close(read_usda(text), JADE)


def test_usd_as_another_writer_has_it_is_read() -> None:
    pytest.importorskip("pxr", reason="the usd-core package is absent")
    from pxr import Sdf, Usd, UsdGeom, UsdShade  # type: ignore[import-untyped, unused-ignore]

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 0.001)
    material = UsdShade.Material.Define(stage, "/looks/jade")
    shader = UsdShade.Shader.Define(stage, "/looks/jade/shader")
    shader.CreateIdAttr("ND_open_pbr_surface_surfaceshader")
    for key, kind, value in (
        ("transmission_weight", Sdf.ValueTypeNames.Float, 1.0),
        ("transmission_color", Sdf.ValueTypeNames.Color3f, COLOR),
        ("transmission_depth", Sdf.ValueTypeNames.Float, 20.0),
        ("specular_ior", Sdf.ValueTypeNames.Float, 1.6),
        ("base_metalness", Sdf.ValueTypeNames.Float, 0.0),
    ):
        shader.CreateInput(key, kind).Set(value)
    shader.GetInput("transmission_color").GetAttr().SetDocumentation("a color at a distance")
    shader.CreateInput("base_color", Sdf.ValueTypeNames.Color3f).ConnectToSource(material.ConnectableAPI(), "tint")
    found = read_usda(stage.GetRootLayer().ExportToString())
    np.testing.assert_allclose(found.extinction, JADE.extinction, rtol=1e-6)  # it stores float32
    assert found.ior == pytest.approx(1.6, rel=1e-7)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("#usda", "PXR-USDC", "not .usda text; convert it"),
        ("ND_open_pbr_surface_surfaceshader", "UsdPreviewSurface", "it has no shader ND_open_pbr"),
        ("inputs:transmission_color =", "inputs:transmission_color.connect =", "comes from a node or changes"),
        ("inputs:transmission_depth =", "inputs:transmission_depth.timeSamples =", "comes from a node or changes"),
        ("(0.18, 0.62, 0.35)", "(0.18, 0.62)", "not three numbers"),
        ("(0.18, 0.62, 0.35)", "(0.18, 0.62, 0.35", "not three numbers"),
        ("= 0.02", "= None", "transmission_depth is 'None', not a number"),
        ("= 0.02", "= -1", "negative depth"),
        ("= 0.02", "= 1e-320", "absorption .* not finite"),
        ("metersPerUnit = 1", "metersPerUnit = 0", "metersPerUnit is 0"),
        ("metersPerUnit = 1", "metersPerUnit = one", "metersPerUnit is 'one', not a number"),
        ("transmission_weight = 1.0", "transmission_weight = 0", "so it is opaque"),
    ],
)
def test_a_bad_usd_layer_is_refused_in_one_line(old: str, new: str, message: str) -> None:
    assert old in USD
    with pytest.raises(tl.InputError, match=message) as caught:
        read_usda(USD.replace(old, new))
    assert "\n" not in str(caught.value)


def test_a_usd_layer_cut_short_anywhere_is_read_or_refused() -> None:
    messages = []
    for end in range(len("#usda"), len(USD)):
        try:
            close(read_usda(USD[:end]), JADE)
        except tl.InputError as error:
            messages.append(str(error))
    assert len(messages) > 100
    assert not any("\n" in message for message in messages)
