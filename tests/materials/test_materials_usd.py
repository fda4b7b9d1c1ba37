"""Media in USD: written, and read as we and others write it."""

from __future__ import annotations

import numpy as np
import pytest

import translucent as tl
from tests.values.media import CLEAR, COLOR, JADE, MILK, close
from translucent.formulas.color import srgb_to_linear
from translucent.materials import text_block
from translucent.materials.usd import read_usda, usda_text


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
        np.testing.assert_allclose(read_usda(encoded).transmittance(0.02), srgb_to_linear(COLOR), rtol=1e-12)


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
        ("#usda", "PXR-USDC", r"not .usda text; convert the file, for example with usdcat -o out\.usda FILE"),
        ("ND_open_pbr_surface_surfaceshader", "UsdPreviewSurface", "the file has no shader ND_open_pbr"),
        (
            "inputs:transmission_color =",
            "inputs:transmission_color.connect =",
            "is connected to a node or changes with time",
        ),
        (
            "inputs:transmission_depth =",
            "inputs:transmission_depth.timeSamples =",
            "is connected to a node or changes with time",
        ),
        ("(0.18, 0.62, 0.35)", "(0.18, 0.62)", "not three numbers"),
        ("(0.18, 0.62, 0.35)", "(0.18, 0.62, 0.35", "not three numbers"),
        ("= 0.02", "= None", "the value of transmission_depth is 'None', and not a number"),
        ("= 0.02", "= -1", r"the transmission color is outside 0\.\.1, or the depth is negative"),
        ("= 0.02", "= 1e-320", "absorption .* not finite"),
        ("metersPerUnit = 1", "metersPerUnit = 0", "metersPerUnit is 0"),
        ("metersPerUnit = 1", "metersPerUnit = one", "the value of metersPerUnit is 'one', and not a number"),
        ("transmission_weight = 1.0", "transmission_weight = 0", "is 0, so the material is opaque"),
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
