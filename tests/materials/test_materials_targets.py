"""Media in the terms of other systems, there and back, and where those terms are known to mislead."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.values.media import CLEAR, COLOR, GLOW, JADE, MILK, close
from translucent.formulas.color import srgb_to_linear, to_hex
from translucent.gltf.file import GltfFile
from translucent.gltf.materials import materials_of
from translucent.materials import TARGETS, load_medium, text_block
from translucent.materials.engines import (
    LONGEST_CM,
    from_mean_free_path_cm,
    from_unity,
    mean_free_path_cm,
    read_json,
    write_json,
)
from translucent.materials.materialx import OPENPBR, STANDARD_SURFACE
from translucent.media.medium import BLACKEST, color_at, extinction_at

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


@pytest.mark.parametrize("surface", [(OPENPBR.write, OPENPBR.read), (STANDARD_SURFACE.write, STANDARD_SURFACE.read)])
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

    def test_more_scattering_than_extinction_is_shifted_by_gray(self, surface: Any) -> None:
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
        np.testing.assert_allclose(read(text).transmittance(0.02), srgb_to_linear(COLOR), rtol=1e-12)

    @pytest.mark.parametrize(
        ("old", "new", "message"),
        [
            ("</materialx>", "", "XML of the file is broken"),
            ('type="color3" value="0.18, 0.62, 0.35"', 'type="color3" value="0.18, 0.62"', "not three numbers"),
            ('type="color3" value="0.18, 0.62, 0.35"', 'type="color3" nodename="x"', "is connected to a node"),
            ('value="0.02"', 'value="deep"', "not a number"),
            ('value="0.02"', 'value="-1"', "the depth is negative"),
            ("0.18, 0.62, 0.35", "1.18, 0.62, 0.35", "outside 0..1"),
            ("lin_rec709", "acescg", "the color space is 'acescg'"),
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
        other = OPENPBR.write if surface[0] == STANDARD_SURFACE.write else STANDARD_SURFACE.write
        with pytest.raises(tl.InputError, match="the file has no element <"):
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
    distance, ior, smoothness = (float(re.findall(r", ([\d.e-]+)f", line)[0]) for line in lines[1:])
    np.testing.assert_allclose(from_unity(color, distance, ior).extinction, JADE.extinction, rtol=1e-7)
    assert (distance, ior, smoothness) == (0.02, 1.6, 1)


def test_unity_names_its_properties_and_its_formula_gives_our_extinction() -> None:
    """The formula of its shader library adds the smallest step of float32 to the color before the logarithm."""
    for color in (COLOR, (1.5e-5, 0.5, 1.0)):
        medium = tl.Medium.from_color(color, 0.02)
        lines = text_block("unity", medium, color, 0.02).splitlines()[1:]
        names = ("_TransmittanceColor", "_ATDistance", "_Ior", "_Smoothness")
        assert [re.findall(r'Set(Color|Float)\("(\w+)"', line)[0][1] for line in lines] == list(names)
        encoded = np.array([float(v) for v in re.findall(r"([\d.e-]+)f", lines[0])])
        linear = srgb_to_linear(encoded)
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
    engines = ("blender", "threejs", "godot", "unreal", "unity")
    for name in ("gltf", "openpbr", "standard_surface", *engines, "usd", "css", "json"):
        assert name in str(caught.value)
        assert name in TARGETS


@pytest.mark.parametrize("distance", [0.0, -1.0, math.inf, math.nan])
def test_a_distance_that_is_none_is_refused(distance: float) -> None:
    with pytest.raises(tl.InputError, match="the distance must be finite and above 0"):
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
        ("{", r"the JSON is broken \("),
        ("[]", "not an object"),
        ('{"absorbtion": 1}', "the JSON has the unknown keys absorbtion"),
        ('{"ior": "glass"}', "the value of ior is 'glass', and not a number"),
        ('{"absorption": [1, 2]}', "the value must be one or three numbers"),
        ('{"absorption": NaN}', "NaN is not a JSON number"),
    ],
)
def test_bad_json_is_refused(text: str, message: str) -> None:
    with pytest.raises(tl.InputError, match=message):
        read_json(text)


def test_css_has_the_color_and_a_gradient() -> None:
    text = text_block("css", JADE, COLOR, 0.02)
    assert "color(srgb-linear 0.18 0.62 0.35)" in text
    assert re.search(r"linear-gradient\(to right, #ffffff, (#[0-9a-f]{6}, ){7}#[0-9a-f]{6}\)", text)
    assert to_hex(COLOR) in text


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
        (
            "a.glb",
            "",
            "suffix '.glb'; give a .json, .mtlx, .py, .js, .gdshader, .txt, .cs, .usda file; for glTF, see translucent",
        ),
        ("a.mtlx", "<materialx><open_pbr_surface>", "a.mtlx'; OpenPBR document; the XML of the file is broken ("),
        ("a.mtlx", "<materialx/>", "a.mtlx'; Standard Surface document; the file has no element <standard_surface>"),
        ("a.usda", "", "not .usda text"),
    ],
)
def test_files_that_hold_no_material_are_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(tl.InputError, match=re.escape(message)):
        load_medium(tmp_path / name)
    with pytest.raises(tl.InputError, match=r"no file has this path|suffix"):
        load_medium(tmp_path / "none" / name)
