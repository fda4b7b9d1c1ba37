"""Materials for engines: each text is read back to the medium that it was written for, and has its surface."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import translucent as tl
from tests.values.media import CLEAR, COLOR, GLOW, JADE, MILK, close
from translucent.gltf.file import GltfFile
from translucent.gltf.materials import materials_of
from translucent.materials import TARGETS, load_medium, load_roughness, text_block
from translucent.materials.blender import read_blender
from translucent.materials.engines import LARGEST_IOR, read_godot, read_threejs, read_unity, read_unreal

#: The suffix of a file of each target, how far its digits go, and whether it holds scattering.
FILES = {
    "gltf": (".json", 1e-12, False),
    "openpbr": (".mtlx", 1e-12, True),
    "standard_surface": (".mtlx", 1e-12, True),
    "blender": (".py", 1e-12, True),
    "threejs": (".js", 1e-12, False),
    "godot": (".gdshader", 1e-15, False),
    "unreal": (".txt", 1e-8, False),
    "unity": (".cs", 1e-7, False),
    "usd": (".usda", 1e-12, True),
    "json": (".json", 1e-15, True),
}

sigma = st.floats(1e-3, 1e5)
colors = st.tuples(sigma, sigma, sigma)
media = st.builds(
    lambda absorption, scattering, g, ior: tl.Medium(absorption, scattering, anisotropy=g, ior=ior),
    colors,
    st.one_of(st.just((0.0, 0.0, 0.0)), colors),
    st.floats(-0.99, 0.99),
    st.floats(1.0, 2.3),
)


def carried(medium: tl.Medium, target: str) -> tl.Medium:
    """Values that a target holds of a medium."""
    if FILES[target][2]:
        return medium
    return tl.Medium(absorption=medium.extinction, ior=medium.ior)


def test_all_targets_but_css_are_read() -> None:
    assert {*FILES, "css"} == set(TARGETS)
    assert {name for name, target in TARGETS.items() if target.read} == set(FILES)


@pytest.mark.parametrize("target", FILES)
@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(medium=media, depth=st.floats(0.01, 5.0), roughness=st.floats(0, 1))
def test_what_is_written_is_read_back(
    tmp_path: Path, target: str, medium: tl.Medium, depth: float, roughness: float
) -> None:
    suffix, rtol, _ = FILES[target]
    distance = depth / float(medium.extinction.max())
    with np.errstate(under="ignore"):
        text = text_block(target, medium, medium.transmittance(distance), distance, roughness)
    (tmp_path / f"a{suffix}").write_text(text)
    found, expected = load_medium(tmp_path / f"a{suffix}"), carried(medium, target)
    # A color near white has lost digits of the extinction, which a logarithm does not bring back.
    close(found, expected, max(rtol, 1e-8 if target == "unity" else 1e-15) / min(1.0, depth) ** 2)
    assert found.ior == pytest.approx(expected.ior, rel=1e-8)
    assert load_roughness(tmp_path / f"a{suffix}") == pytest.approx(0.0 if target == "json" else roughness, abs=1e-8)
    if FILES[target][2] and medium.scatters:
        assert found.anisotropy == medium.anisotropy


@pytest.mark.parametrize("target", FILES)
@pytest.mark.parametrize("medium", [JADE, MILK, CLEAR], ids=["jade", "milk", "clear"])
def test_named_media_are_read_back(tmp_path: Path, target: str, medium: tl.Medium) -> None:
    path = tmp_path / f"a{FILES[target][0]}"
    path.write_text(text_block(target, medium, medium.transmittance(1e-4), 1e-4))
    close(load_medium(path), carried(medium, target), 1e-7)
    assert load_medium(path).ior == medium.ior


@pytest.mark.parametrize(
    ("name", "old", "new", "expected"),
    [
        ("openpbr.mtlx", '<input name="specular_roughness" type="float" value="0.4" />', "", 0.3),
        ("standard_surface.mtlx", '<input name="specular_roughness" type="float" value="0.4" />', "", 0.2),
        ("openpbr.mtlx", 'specular_roughness" type="float" value="0.4"', 'specular_roughness" nodename="a"', 0.0),
        ("usd.usda", "float inputs:specular_roughness = 0.4", "", 0.3),
        ("usd.usda", "specular_roughness = 0.4", "specular_roughness.connect = </a>", 0.0),
        ("gltf.json", '"roughnessFactor": 0.4', '"a": 0', 1.0),
        ("gltf.json", '"roughnessFactor": 0.4', '"metallicRoughnessTexture": {"index": 0}', 0.0),
        ("gltf.json", "0.4", '"rough"', None),
        ("openpbr.mtlx", 'value="0.4"', 'value="rough"', None),
        ("usd.usda", "roughness = 0.4", "roughness = 0.4.4", None),
        ("threejs.js", "roughness: 0.4", "roughness: 1.5", None),
        ("unity.cs", '"_Smoothness", 0.6', '"_Smoothness", 2', None),
        ("unreal.txt", "= 0.4", "=", None),
    ],
)
def test_a_roughness_that_is_changed_missing_or_wrong(
    tmp_path: Path, name: str, old: str, new: str, expected: float | None
) -> None:
    text = text_block(name.partition(".")[0], JADE, COLOR, 0.02, 0.4)
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new))
    if expected is None:
        with pytest.raises(tl.InputError, match=r"roughness|without a number"):
            load_roughness(tmp_path / name)
    else:
        assert load_roughness(tmp_path / name) == expected
        assert load_medium(tmp_path / name).ior == 1.6


def test_blender_carries_a_glow() -> None:
    found = read_blender(text_block("blender", GLOW, GLOW.transmittance(0.1), 0.1))
    close(found, GLOW)
    np.testing.assert_allclose(found.emission, GLOW.emission, rtol=1e-15)


# Surfaces


def test_blender_has_glass_around_the_volume() -> None:
    text = text_block("blender", JADE, COLOR, 0.02, 0.3)
    assert 'surface = nodes.new("ShaderNodeBsdfGlass")\nsurface.distribution = "MULTI_GGX"' in text
    assert 'surface.inputs["IOR"].default_value = 1.6' in text
    assert 'surface.inputs["Roughness"].default_value = 0.3' in text
    assert 'links.new(surface.outputs["BSDF"], output.inputs["Surface"])' in text


def test_blender_has_no_surface_where_there_is_none() -> None:
    plain = tl.Medium.from_color(COLOR, 0.02)
    assert "surface" not in text_block("blender", plain, COLOR, 0.02)
    assert "Glass" in text_block("blender", plain, COLOR, 0.02, 0.5)


def test_threejs_states_the_color_at_a_distance_and_a_thickness() -> None:
    text = text_block("three.js", JADE, COLOR, 0.02, 0.3)
    for line in ("roughness: 0.3,", "transmission: 1,", "ior: 1.6,", "thickness: 0.02,", "attenuationDistance: 0.02,"):
        assert f"  {line}" in text
    assert "setRGB(0.18, 0.62, 0.35, THREE.LinearSRGBColorSpace)" in text
    assert "thickness is one number for the whole mesh" in text
    assert "attenuation" not in text_block("threejs", CLEAR, (1, 1, 1), 0.02)
    dense = tl.Medium(absorption=1.0, ior=3.0)
    assert read_threejs(text_block("threejs", dense, dense.transmittance(1), 1)).ior == LARGEST_IOR


def test_the_text_for_threejs_is_javascript() -> None:
    """Run by node with stand-ins of three.js, whose material keeps what it is given."""
    if (node := shutil.which("node")) is None:
        pytest.skip("node is absent")
    stand_in = """
const THREE = { LinearSRGBColorSpace: "srgb-linear",
  MeshPhysicalMaterial: class { constructor(given) { Object.assign(this, given); } },
  Color: class { setRGB(r, g, b, space) { this.rgb = [r, g, b, space]; return this; } } };
"""
    program = f"{stand_in}{text_block('threejs', JADE, COLOR, 0.02, 0.3)}\nconsole.log(JSON.stringify(material));"
    made = json.loads(subprocess.run([node, "-e", program], capture_output=True, text=True, check=True).stdout)
    assert made == {
        "roughness": 0.3, "metalness": 0, "transmission": 1, "ior": 1.6, "thickness": 0.02,
        "attenuationColor": {"rgb": [*COLOR, "srgb-linear"]}, "attenuationDistance": 0.02,
    }  # fmt: skip


def test_godot_has_the_extinction_and_a_constant_thickness() -> None:
    text = text_block("godot", JADE, COLOR, 0.02, 0.3)
    assert text.startswith("shader_type spatial;")
    assert "uniform float thickness = 0.02;" in text
    assert "uniform float roughness : hint_range(0.0, 1.0) = 0.3;" in text
    assert text.count("{") == text.count("}") == 1
    np.testing.assert_array_equal(read_godot(text).extinction, JADE.extinction)


def test_unreal_reflects_as_fresnel_says() -> None:
    text = text_block("unreal", JADE, COLOR, 0.02, 0.3)
    assert float(re.findall(r"F0 += (.*)", text)[0]) == pytest.approx((0.6 / 2.6) ** 2)
    assert re.search(r"Roughness += 0\.3\n", text)
    assert re.search(r"\(IOR\) += 1\.6$", text)


def test_unity_has_a_smoothness() -> None:
    assert 'SetFloat("_Smoothness", 0.7f)' in text_block("unity", JADE, COLOR, 0.02, 0.3)


def test_gltf_is_no_metal() -> None:
    entry = json.loads(text_block("gltf", JADE, COLOR, 0.02, 0.3))
    assert entry["pbrMetallicRoughness"] == {"metallicFactor": 0.0, "roughnessFactor": 0.3}
    (found,) = materials_of(GltfFile(Path("a.gltf"), {"asset": {"version": "2.0"}, "materials": [entry]}))
    assert found.medium() == JADE


@pytest.mark.parametrize("target", ["openpbr", "standard_surface", "usd"])
def test_graphs_state_their_roughness(target: str) -> None:
    assert re.search(r"specular_roughness.*0\.3\b", text_block(target, JADE, COLOR, 0.02, 0.3))


@pytest.mark.parametrize("roughness", [-0.1, 1.1, math.nan])
def test_a_roughness_that_is_none_is_refused(roughness: float) -> None:
    with pytest.raises(tl.InputError, match="the roughness must lie in 0 to 1"):
        text_block("blender", JADE, COLOR, 0.02, roughness)


# What is no such text


@pytest.mark.parametrize("read", [read_blender, read_threejs, read_godot, read_unity, read_unreal])
def test_another_text_is_refused(read: object) -> None:
    for text in ("", "import os", "\x00", "  ior:\n", "SSS MFP (cm) = (1, 2)"):
        with pytest.raises(tl.InputError, match=r"the text has no|is not followed by"):
            read(text)  # type: ignore[operator]


def test_a_value_out_of_range_is_refused() -> None:
    text = text_block("blender", JADE, COLOR, 0.02)
    with pytest.raises(tl.InputError, match="ior"):
        read_blender(text.replace("1.6", "0.5"))
    with pytest.raises(tl.InputError, match="Density"):
        read_blender(re.sub(r'"Density"\].default_value = ', '"Density"].default_value = -', text))


@pytest.mark.parametrize(
    ("target", "old", "new", "message"),
    [
        ("threejs", "setRGB(0.18", "setRGB(1.18", "is outside 0..1"),
        ("threejs", "attenuationDistance: 0.02", "attenuationDistance: 0", ", but must be above 0"),
        ("unity", '"_ATDistance", 0.02', '"_ATDistance", -1', ", but must be above 0"),
        ("unity", "new Color(0", "new Color(-1", "is outside 0..1"),
        (
            "unreal",
            "SSS MFP (cm)                 = (",
            "SSS MFP (cm)  = (-",
            "the mean free path must be three lengths above 0",
        ),
        ("godot", "vec3(", "vec3(-", "negative"),
    ],
)
def test_an_engine_s_value_out_of_range_is_refused(
    tmp_path: Path, target: str, old: str, new: str, message: str
) -> None:
    text = text_block(target, JADE, COLOR, 0.02)
    assert old in text
    path = tmp_path / f"a{FILES[target][0]}"
    path.write_text(text.replace(old, new))
    with pytest.raises(tl.InputError, match=re.escape(message)):
        load_medium(path)


def test_a_gltf_material_without_a_volume_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text('{"extensions": {}}')
    with pytest.raises(tl.InputError, match="the material has no volume"):
        load_medium(tmp_path / "a.json")
