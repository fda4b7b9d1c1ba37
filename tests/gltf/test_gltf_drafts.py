"""Drafts of glTF extensions for scattering: written and read back, their formulas, and the error of their color."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import translucent as tl
from tests.command_line import Run
from tests.gltf.gltf_writer import COLOR, Writer, glass, material_scene
from translucent.gltf.file import read_gltf
from translucent.gltf.materials import read_materials
from translucent.media.albedo import hulst_albedo
from translucent.reference.slabs import total_fractions

Json = dict[str, Any]

SCATTER, VOLUME_SCATTER = "KHR_materials_scatter", "KHR_materials_volume_scatter"
EXTINCTION = -np.log(COLOR) / 0.5


def box(path: Path, *, used: tuple[str, ...] = (), **extensions: Any) -> Path:
    """A box of a medium with color and distance, and these extensions besides."""
    writer = Writer()
    volume = glass(ior=1.4, attenuationColor=COLOR, attenuationDistance=0.5)
    material = writer.material(name="Wax", extensions={**volume, **extensions})
    writer.mesh(writer.primitive(material=material))
    writer.tree["accessors"][1] |= {"min": [-1, -2, -3], "max": [1, 2, 3]}
    writer.tree["extensionsUsed"] = sorted({*volume, *extensions, *used})
    writer.add("nodes", mesh=0)
    return writer.save(path)


def medium_of(path: Path) -> tl.Medium:
    (material,) = read_materials(path, draft_extensions=True)
    medium = material.medium()
    assert medium is not None
    return medium


def albedo_of(medium: tl.Medium) -> np.ndarray:
    return np.asarray(medium.scattering) / medium.extinction


def printed(color: Any, g: float) -> np.ndarray:
    """The formula as both drafts print it."""
    c = np.asarray(color, dtype=float)
    s = 4.09712 + 4.20863 * c - np.sqrt(9.59217 + 41.6808 * c + 17.7126 * c**2)
    return (1 - s**2) / (1 - g * s**2)


@pytest.mark.parametrize(
    ("extension", "stated", "color", "g"),
    [
        (SCATTER, {"scatterStrengthFactor": 1, "multiscatterColorFactor": [0.8, 0.6, 0.5]}, [0.8, 0.6, 0.5], 0.0),
        (SCATTER, {"scatterStrengthFactor": 0.5, "scatterAnisotropy": 0.7}, [0.5, 0.5, 0.5], 0.7),
        (SCATTER, {"scatterFactor": 1, "multiscatterColorFactor": [0.8, 0.6, 0.5]}, [0.8, 0.6, 0.5], 0.0),
        (SCATTER, {"multiscatterColorFactor": [0.8, 0.6, 0.5]}, [0, 0, 0], 0.0),
        (VOLUME_SCATTER, {"multiscatterColorFactor": [0.8, 0.6, 0.5]}, [0.8, 0.6, 0.5], 0.0),
        (VOLUME_SCATTER, {"multiscatterColor": [0.8, 0.6, 0.5], "scatterAnisotropy": 0.7}, [0.8, 0.6, 0.5], 0.0),
        (VOLUME_SCATTER, {"scatterAlbedo": [0.8, 0.6, 0.5]}, [0.8, 0.6, 0.5], 0.0),
        (VOLUME_SCATTER, {}, [0, 0, 0], 0.0),
    ],
)
def test_a_draft_is_read_by_its_own_formula(tmp_path: Path, extension: str, stated: Json, color: Any, g: float) -> None:
    """The formula of volume_scatter leaves the anisotropy out of the color."""
    medium = medium_of(box(tmp_path / "box.glb", **{extension: stated}))
    np.testing.assert_allclose(medium.extinction, EXTINCTION, rtol=1e-14)  # its meaning, not its value, changes
    np.testing.assert_allclose(albedo_of(medium), printed(color, g), atol=2e-5)  # six digits are printed
    assert medium.anisotropy == stated.get("scatterAnisotropy", 0.0)
    assert medium.ior == 1.4


@pytest.mark.parametrize("draft", ["scatter", "volume-scatter"])
@pytest.mark.parametrize("g", [-0.5, 0.0, 0.8])
def test_a_medium_comes_back_as_it_was_written(tmp_path: Path, draft: Any, g: float) -> None:
    medium = tl.Medium(absorption=(1, 20, 0), scattering=(300, 4, 0), anisotropy=g, ior=1.44)
    tl.write_medium(box(tmp_path / "box.glb"), tmp_path / "out.glb", medium, draft_extensions=draft)
    found = medium_of(tmp_path / "out.glb")
    np.testing.assert_allclose(found.extinction, medium.extinction, rtol=1e-13)
    np.testing.assert_allclose(found.scattering, medium.scattering, rtol=1e-12)
    np.testing.assert_allclose(found.absorption, medium.absorption, rtol=1e-10)
    assert (found.anisotropy, found.ior) == (g, 1.44)
    tree = read_gltf(tmp_path / "out.glb").tree
    assert (SCATTER in tree["extensionsUsed"]) == (draft == "scatter")
    (plain,) = read_materials(tmp_path / "out.glb")  # without the flag it is what a viewer without the draft shows
    assert not plain.medium().scatters  # type: ignore[union-attr]


def test_a_new_draft_takes_the_place_of_the_old_one(tmp_path: Path) -> None:
    old = box(tmp_path / "box.glb", **{VOLUME_SCATTER: {"multiscatterColorFactor": [0.5, 0.5, 0.5]}})
    milk = tl.preset("whole_milk").medium
    tl.write_medium(old, tmp_path / "milk.glb", milk, draft_extensions="scatter")
    extensions = read_gltf(tmp_path / "milk.glb").tree["materials"][0]["extensions"]
    assert SCATTER in extensions
    assert VOLUME_SCATTER not in extensions
    clear = tl.Medium.from_color((0.5, 0.6, 0.7), 0.01)
    tl.write_medium(tmp_path / "milk.glb", tmp_path / "clear.glb", clear, draft_extensions="scatter")
    assert SCATTER not in read_gltf(tmp_path / "clear.glb").tree["materials"][0]["extensions"]


@pytest.mark.parametrize(("g", "most"), [(-0.5, 0.0091), (0.0, 0.0022), (0.5, 0.0010), (0.8, 0.0014)])
def test_how_well_the_color_is_that_of_a_thick_body(g: float, most: float) -> None:
    """Against radiative transfer of a layer of 1e5 mean free paths in diffuse light, without an interface."""
    colors = np.array([0.06, 0.22, 0.5, 0.8])
    true = [total_fractions(float(albedo), 1e5, 1.0, g)[0] for albedo in hulst_albedo(colors, g)]
    assert np.abs(true - colors).max() < most


def test_an_interface_makes_the_color_darker() -> None:
    """Both drafts leave this out: 0.58 is seen as 0.33 behind the interface of glass."""
    (albedo,) = hulst_albedo([0.58])
    assert total_fractions(float(albedo), 1e5, 1.5)[0] == pytest.approx(0.58 - 0.2515, abs=1e-3)


def test_a_scene_scatters_where_drafts_are_asked_for(tmp_path: Path) -> None:
    scatter = {"scatterStrengthFactor": 1, "multiscatterColorFactor": [0.8, 0.6, 0.5], "scatterAnisotropy": 0.2}
    material = {"extensions": {**glass(attenuationColor=COLOR, attenuationDistance=0.5), SCATTER: scatter}}
    scene = material_scene(tmp_path, material, draft_extensions=True, unit="cm")
    (medium,) = [item.medium for item in scene.objects]
    np.testing.assert_allclose(medium.extinction, 100 * EXTINCTION, rtol=1e-14)
    np.testing.assert_allclose(albedo_of(medium), printed([0.8, 0.6, 0.5], 0.2), atol=2e-5)
    assert scene.left_out == ()
    path = box(tmp_path / "box.glb", **{SCATTER: scatter})
    with pytest.warns(tl.TranslucentWarning, match=SCATTER):
        plain = tl.load_scene(path)
    assert not plain.objects[0].medium.scatters  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ({"scatterAnisotropy": 1}, "scatterAnisotropy 1 is not between -1 and 1"),
        ({"scatterStrengthFactor": 2}, "scatterStrengthFactor 2 is not in 0..1"),
        ({"multiscatterColorFactor": [1, 2, 0]}, r"multiscatterColorFactor\[1\] 2 is not in 0..1"),
        ([], "KHR_materials_scatter is \\[\\], not an object"),
    ],
)
def test_wrong_values_are_refused_where_they_are_read(tmp_path: Path, stated: Any, told: str) -> None:
    path = box(tmp_path / "box.glb", **{SCATTER: stated})
    with pytest.raises(tl.InputError, match=told):
        read_materials(path, draft_extensions=True)
    assert len(read_materials(path)) == 1


def test_what_a_draft_excludes_and_what_is_not_read_is_told(tmp_path: Path) -> None:
    diffuse = {"KHR_materials_diffuse_transmission": {"diffuseTransmissionFactor": 0.5}}
    path, medium = box(tmp_path / "box.glb", **diffuse), tl.Medium(absorption=1, scattering=2)
    with pytest.raises(tl.InputError, match=r"excludes KHR_materials_scatter.*write the draft 'volume-scatter'"):
        tl.write_medium(path, tmp_path / "out.glb", medium, draft_extensions="scatter")
    assert tl.write_medium(path, tmp_path / "out.glb", medium, draft_extensions="volume-scatter") == [0]
    with pytest.raises(tl.InputError, match="draft_extensions 'sss'"):
        tl.write_medium(path, tmp_path / "out.glb", medium, draft_extensions="sss")  # type: ignore[arg-type]
    textured = {SCATTER: {"multiscatterColorTexture": {"index": 0}}}
    (material,) = read_materials(box(tmp_path / "textured.glb", **textured), draft_extensions=True)
    assert f"{SCATTER} has multiscatterColorTexture, which is not read" in material.warnings
    assert any("nothing scatters" in line for line in material.warnings)


def test_the_command_line_writes_and_shows_scattering(run: Run, tmp_path: Path) -> None:
    path, out = box(tmp_path / "box.glb"), tmp_path / "out.glb"
    code, _, err = run("material", "apply", path, "--preset", "wax", "--draft-extensions", "-o", out)
    assert (code, err) == (0, "")
    assert "scattering" not in run("material", "show", out).out
    assert "scattering" in run("material", "show", out, "--draft-extensions").out
    assert "KHR_materials_scatter" not in run("explain", out, "--draft-extensions").err
    assert "KHR_materials_scatter" in run("explain", out).err
    assert "draft-extension" in run("material", "check", out).out
