"""Bodies, thin walls and opaque objects of glTF materials, and what they lose."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import translucent as tl
from tests.gltf.gltf_writer import COLOR, WINE, Json, Writer, glass, load, material_scene
from translucent.gltf.objects import BLENDED, WALL_SHARE

HALF = {"baseColorFactor": [1.0, 1.0, 1.0, 0.5]}


def test_a_volume_is_a_body_whose_attenuation_no_scale_changes(tmp_path: Path) -> None:
    (body,) = material_scene(tmp_path, {"extensions": WINE}).objects
    assert body.sheet_thickness is None
    np.testing.assert_allclose(body.medium.transmittance(0.5), COLOR, rtol=1e-14)
    assert body.medium.ior == 1.33


@pytest.mark.parametrize("thickness", [None, 0.0])
def test_transmission_without_a_volume_is_a_thin_wall_with_its_tint(tmp_path: Path, thickness: float | None) -> None:
    base = {"baseColorFactor": [*COLOR, 1.0]}
    volume = {} if thickness is None else {"attenuationColor": [0.5] * 3, "attenuationDistance": 0.1}
    material = {"extensions": glass(1.0, thickness, **volume), "pbrMetallicRoughness": base}
    scene = material_scene(tmp_path, material)
    (wall,) = scene.objects
    assert wall.sheet_thickness == pytest.approx(WALL_SHARE * scene.diagonal, rel=1e-14)
    np.testing.assert_allclose(wall.medium.transmittance(wall.sheet_thickness), COLOR, rtol=1e-14)
    assert wall.medium.ior == 1.5
    assert scene.left_out == ()
    truth = tl.reference.render(scene, (3, 3))
    assert truth.coverage[1, 1]
    # Two faces, each at a slant: between the squares of the straight tint and of its 1.34th power.
    assert (truth.transmittance[1, 1] <= np.square(COLOR)).all()
    assert (truth.transmittance[1, 1] >= np.power(COLOR, 2 * 1.35)).all()


@pytest.mark.parametrize(
    "extensions",
    [
        {},
        glass(0.0, 2.0, attenuationColor=COLOR, attenuationDistance=1.0),
        {"KHR_materials_volume": {"thicknessFactor": 1.0}},
        glass(0.0, None),
        {"VENDOR_lacquer": {}},
        glass(0.0) | {"VENDOR_lacquer": {}},
        glass(0.0) | {"KHR_materials_diffuse_transmission": {}},
    ],
    ids=["plain", "volume with transmission 0", "volume alone", "transmission 0", "unknown", "its volume", "diffuse 0"],
)
def test_everything_else_is_opaque_in_its_base_color(tmp_path: Path, extensions: Json) -> None:
    material = {"extensions": extensions, "pbrMetallicRoughness": {"baseColorFactor": [0.25, 0.5, 0.75, 0.5]}}
    (item,) = material_scene(tmp_path, material).objects
    assert (item.medium, item.sheet_thickness) == (None, None)
    assert np.asarray(item.color).tolist() == [0.25, 0.5, 0.75]


@pytest.mark.parametrize(
    ("material", "line"),
    [
        ({"alphaMode": "BLEND", "pbrMetallicRoughness": HALF}, f"{BLENDED} ('Stuff')"),
        (
            {"alphaMode": "BLEND", "pbrMetallicRoughness": HALF, "extensions": glass()},
            "alphaMode BLEND of translucent objects ('Stuff')",
        ),
        (
            {"extensions": {"KHR_materials_clearcoat": {"clearcoatNormalTexture": {"index": 0}}}},
            "textures of clear coats ('Stuff')",
        ),
        (
            {"extensions": glass() | {"KHR_materials_iridescence": {"iridescenceTexture": {"index": 0}}}},
            "textures of iridescence ('Stuff')",
        ),
        (
            {
                "extensions": {
                    "KHR_materials_diffuse_transmission": {
                        "diffuseTransmissionFactor": 1,
                        "diffuseTransmissionTexture": {"index": 0},
                    }
                }
            },
            "textures of diffuse transmission ('Stuff')",
        ),
        (
            {"extensions": glass() | {"KHR_materials_dispersion": {"dispersion": 11.0}}},
            "dispersion above 10 ('Stuff')",
        ),
    ],
    ids=lambda v: v if isinstance(v, str) else "",
)
def test_what_a_material_loses_is_told(tmp_path: Path, material: Json, line: str) -> None:
    with pytest.warns(tl.TranslucentWarning) as caught:
        scene = material_scene(tmp_path, {"name": "Stuff", **material})
    assert scene.left_out == (line,)
    assert [str(warning.message) for warning in caught] == [f"scene 'model.glb': left out: {line}"]


def test_losses_are_listed_once_and_shortly(tmp_path: Path) -> None:
    writer = Writer()
    for i in range(6):
        coat = {"KHR_materials_clearcoat": {"clearcoatTexture": {"index": 0}}}
        blend = writer.material(
            name=f"Blend {min(i, 4)}", alphaMode="BLEND", pbrMetallicRoughness=HALF, extensions=coat
        )
        writer.add("nodes", mesh=writer.mesh(writer.primitive(material=blend)))
    writer.tree["extensionsUsed"] = ["KHR_materials_clearcoat", "KHR_materials_volume", "EXT_mesh_gpu_instancing"]
    writer.add("animations", channels=[])
    with pytest.warns(tl.TranslucentWarning):
        scene = load(writer, tmp_path)
    assert scene.left_out == (
        "extensions (EXT_mesh_gpu_instancing)",
        "textures of clear coats ('Blend 0', 'Blend 1', 'Blend 2' and 2 more)",
        f"{BLENDED} ('Blend 0', 'Blend 1', 'Blend 2' and 2 more)",
        "animations (1)",
    )
