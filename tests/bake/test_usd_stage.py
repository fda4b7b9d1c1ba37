"""USD stages: what OpenUSD reads in them, and what its checker says."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

import translucent as tl
from tests.command_line import Run, one_error_line
from translucent.materials.usd import read_usda

pxr = pytest.importorskip("pxr", reason="the usd-core package is absent")
from pxr import Usd, UsdGeom, UsdLux, UsdShade, UsdUtils  # type: ignore[import-untyped, unused-ignore]  # noqa: E402

NODE = "ND_open_pbr_surface_surfaceshader"
JADE = tl.Medium(absorption=(30, 10, 20), scattering=(200, 250, 220), anisotropy=0.3, ior=1.6)


def box(name: str = "box", uv: bool = False) -> tl.Mesh:
    made = trimesh.creation.box((0.02, 0.03, 0.04))
    vertices = np.array(made.vertices)
    return tl.Mesh(vertices, made.faces, uv=vertices[:, :2] + 0.5 if uv else None, name=name)


def scene_of(*objects: tl.Object) -> tl.Scene:
    return tl.Scene(objects, tl.Camera.look_at((0, 0, 1), (0, 0, 0)))


def complaints(path: Path) -> list[str]:
    """Findings of usdchecker: by validators, or by the class that they have replaced."""
    if hasattr(UsdUtils, "ComplianceChecker"):
        checker = UsdUtils.ComplianceChecker(arkit=False, skipARKitRootLayerCheck=True)
        checker.CheckCompliance(str(path))
        return [*checker.GetErrors(), *checker.GetFailedChecks(), *checker.GetWarnings()]
    from pxr import UsdValidation  # type: ignore[import-untyped, unused-ignore]

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 10
    stage = Usd.Stage.Open(str(path))
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    texts = [f"{one.GetName()}: {one.GetMessage()}" for one in found]
    # The package has no definitions of MaterialX, which another test holds against those of MaterialX.
    return [text for text in texts if not ("ND_" in text and text.startswith("MissingShaderIdInRegistry"))]


def surface(prim: Usd.Prim) -> UsdShade.Shader:
    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    return material.ComputeSurfaceSource("mtlx")[0]


@pytest.mark.parametrize("suffix", [".usda", ".usdc", ".usd"])
def test_openusd_reads_meshes_materials_and_thickness(suffix: str, tmp_path: Path) -> None:
    matrix = np.array([[0.0, -2, 0, 0.1], [1, 0, 0, 0.2], [0, 0, -1, 0.3], [0, 0, 0, 1]])
    mesh, rock = box("a box.obj", uv=True), box("a box")
    scene = scene_of(
        tl.Object(mesh, JADE, matrix, surface=tl.Surface(roughness=0.2)),
        tl.Object(rock, surface=tl.Surface(color=(0.5, 0.25, 0.125), metallic=1.0, ior=1.0)),
    )
    baked = tl.bake_vertex_thickness(mesh, rays=4)
    path = tl.write_usd(scene, tmp_path / f"stage{suffix}", [baked])
    assert complaints(path) == []
    stage = Usd.Stage.Open(str(path))
    assert (UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)) == (1.0, "Y")
    assert stage.GetDefaultPrim().GetPath() == "/World"
    first, second = (UsdGeom.Mesh(stage.GetPrimAtPath(f"/World/{name}")) for name in ("a_box", "a_box_"))
    primvars = UsdGeom.PrimvarsAPI(first)
    thickness = primvars.GetPrimvar("thickness")
    assert thickness.GetInterpolation() == "vertex"
    np.testing.assert_array_equal(thickness.Get(), baked.values)
    np.testing.assert_allclose(primvars.GetPrimvar("st").Get(), mesh.uv, rtol=1e-6)  # type: ignore[arg-type]
    assert not UsdGeom.PrimvarsAPI(second).HasPrimvar("thickness")
    # Where the scene has it: rows of USD are columns here.
    to_world = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(first.GetPrim()))
    points = np.column_stack([np.array(first.GetPointsAttr().Get()), np.ones(len(mesh.vertices))]) @ to_world
    np.testing.assert_allclose(points[:, :3], mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-7)
    normals = np.array(first.GetNormalsAttr().Get()).reshape(-1, 3, 3)
    np.testing.assert_allclose(normals, np.repeat(mesh.face_normals[:, None], 3, axis=1), atol=1e-6)
    stated = {one.GetBaseName(): one.Get() for one in surface(second.GetPrim()).GetInputs()}
    assert stated["base_color"] == pytest.approx((0.5, 0.25, 0.125))
    assert stated["base_metalness"] == 1.0
    if suffix == ".usda":  # by our own reader, too
        found = read_usda(path.read_text())
        np.testing.assert_allclose(found.extinction, JADE.extinction, rtol=1e-5)
        np.testing.assert_allclose(found.scattering, JADE.scattering, rtol=1e-5)


def test_inputs_are_those_of_the_definition_in_materialx(tmp_path: Path) -> None:
    mx = pytest.importorskip("MaterialX", reason="the MaterialX package is absent")
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    definition = library.getNodeDef(NODE)
    sheet = tl.Object(box("pane"), tl.Medium(ior=1.5), sheet_thickness=1e-3)
    scene = scene_of(tl.Object(box(), JADE), sheet, tl.Object(box("rock")))
    stage = Usd.Stage.Open(str(tl.write_usd(scene, tmp_path / "stage.usda")))
    types = {"float": "float", "color3f": "color3", "bool": "boolean"}
    for name in ("box", "pane", "rock"):
        shader = surface(stage.GetPrimAtPath(f"/World/{name}"))
        assert shader.GetIdAttr().Get() == NODE
        for one in shader.GetInputs():
            expected = definition.getActiveInput(one.GetBaseName())
            assert expected is not None, one.GetBaseName()
            assert types[str(one.GetTypeName())] == expected.getType()
    assert surface(stage.GetPrimAtPath("/World/pane")).GetInput("geometry_thin_walled").Get()


def test_a_mesh_that_is_inside_out_is_left_handed(tmp_path: Path) -> None:
    made = box()
    mesh = tl.Mesh(made.vertices, made.faces[:, ::-1])
    path = tl.write_usd(scene_of(tl.Object(mesh, JADE)), tmp_path / "stage.usda")
    stage = Usd.Stage.Open(str(path))
    found = UsdGeom.Mesh(stage.GetPrimAtPath("/World/mesh"))
    assert found.GetOrientationAttr().Get() == "leftHanded"
    # Normals look outwards.
    normals = np.array(found.GetNormalsAttr().Get())
    assert (np.einsum("ij,ij->i", normals, mesh.vertices[mesh.faces].reshape(-1, 3)) > 0).all()


def test_the_command_bakes_into_a_stage(run: Run, tmp_path: Path) -> None:
    done = run("bake", "sphere", "--usd", tmp_path / "ball.usda", "--preset", "jade", "--mode", "normal", "--json")
    assert done.code == 0, done.err
    (mesh,) = json.loads(done.out)["meshes"]
    assert complaints(tmp_path / "ball.usda") == []
    stage = Usd.Stage.Open(str(tmp_path / "ball.usda"))
    values = np.array(UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/World/sphere")).GetPrimvar("thickness").Get())
    assert (values.min(), values.max()) == (mesh["min"], mesh["max"])
    np.testing.assert_allclose(values, 0.04, rtol=2e-3)  # the diameter, but for facets
    assert surface(stage.GetPrimAtPath("/World/sphere")).GetInput("specular_ior").Get() == pytest.approx(1.6)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--usd", "ball.obj"], "suffix '.obj'; use .usda, .usdc, .usd"),
        (["--usd", "ball.usda", "-o", "ball.exr"], "--output cannot be combined with --usd"),
        (["--usd", "ball.usda", "--size", "64"], "--size cannot be combined with --usd"),
        (["--usd", "no/ball.usda"], "no"),
    ],
)
def test_what_a_stage_cannot_be_is_refused(more: list[str], message: str, run: Run, tmp_path: Path) -> None:
    done = run("bake", "sphere", *(tmp_path / word if "ball" in word else word for word in more))
    assert message in one_error_line(done)
    assert not list(tmp_path.iterdir())


def test_what_is_not_written_is_named(tmp_path: Path) -> None:
    item = tl.Object(box(), JADE, surface=tl.Surface(clearcoat=0.5))
    with pytest.warns(tl.TranslucentWarning, match=r"'box': clearcoat of surfaces, which are not written"):
        tl.write_usd(scene_of(item), tmp_path / "stage.usda")
    with pytest.raises(tl.InputError, match="the scene has no object with this mesh"):
        tl.write_usd(scene_of(item), tmp_path / "stage.usda", [tl.bake_vertex_thickness(box(), rays=2)])


def test_camera_lights_and_pictures_of_base_colors(tmp_path: Path) -> None:
    OpenEXR = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    pixels = np.linspace(0, 1, 24, dtype=np.float32).reshape(2, 4, 3)
    texture = tl.Texture(pixels, scale=(2, 3), offset=(0.25, 0), rotation=90, wrap=("repeat", "clamp"))
    painted = tl.Object(box("rock", uv=True), surface=tl.Surface(color=(1, 0.5, 1), color_texture=texture))
    lights = (
        tl.PointLight((1, 2, 3), (2, 1, 0)),
        tl.SphereLight((0, 1, 0), 3.0, radius=0.1),
        tl.SpotLight((0, 2, 0), (0, -1, 0), 5.0, inner_cone=15, outer_cone=30),
        tl.DirectionalLight((1, -1, 0), (4, 4, 2)),
    )
    camera = tl.Camera.look_at((0.3, 0.2, 1), (0, 0, 0), fov_y=30)
    scene = tl.Scene([painted], camera, lights=lights, environment=tl.Environment.constant((0.5, 1, 2)))
    path = tl.write_usd(scene, tmp_path / "stage.usda")
    assert complaints(path) == []
    stage = Usd.Stage.Open(str(path))
    seen = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera()
    assert seen.GetFieldOfView(seen.FOVVertical) == pytest.approx(30)
    np.testing.assert_allclose(np.array(seen.transform).T, camera.pose, atol=1e-12)
    found = [UsdLux.LightAPI(stage.GetPrimAtPath(f"/World/Lights/light_{i}")) for i in range(4)]
    power = [one.GetIntensityAttr().Get() * np.array(one.GetColorAttr().Get()) for one in found]
    # Of a sphere of radiance L one side has the radiant intensity L pi r^2; `normalize` divides by 4 pi r^2.
    np.testing.assert_allclose(np.array(power) / [[4], [4], [4], [1]], [(2, 1, 0), (3, 3, 3), (5, 5, 5), (4, 4, 2)])
    assert all(one.GetNormalizeAttr().Get() for one in found)
    sun = np.array(UsdGeom.Xformable(found[3]).GetLocalTransformation())
    np.testing.assert_allclose(-sun[2, :3], np.array([1, -1, 0]) / 2**0.5, atol=1e-12)
    dome = UsdLux.LightAPI(stage.GetPrimAtPath("/World/Lights/environment"))
    np.testing.assert_allclose(dome.GetIntensityAttr().Get() * np.array(dome.GetColorAttr().Get()), (0.5, 1, 2))
    mesh = stage.GetPrimAtPath("/World/rock")
    shader = surface(mesh)
    product = UsdShade.Shader(shader.GetInput("base_color").GetConnectedSources()[0][0].source.GetPrim())
    np.testing.assert_allclose(product.GetInput("in2").Get(), (1, 0.5, 1))
    picture = UsdShade.Shader(product.GetInput("in1").GetConnectedSources()[0][0].source.GetPrim())
    file = picture.GetInput("file").Get().path
    assert [picture.GetInput(f"{axis}addressmode").Get() for axis in "uv"] == ["periodic", "clamp"]
    with OpenEXR.File(str(tmp_path / file), separate_channels=True) as read:
        held = np.stack([read.channels()[name].pixels for name in "RGB"], axis=2)
    np.testing.assert_array_equal(held, pixels)
    at = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st_color").Get())
    plain = tl.Texture(pixels, wrap=texture.wrap)
    np.testing.assert_allclose(plain.sample(at), texture.sample(painted.mesh.uv), atol=1e-5)


def test_an_environment_is_a_picture_as_openexr_maps_directions(tmp_path: Path) -> None:
    """+Z is in the middle, +X to the left of it; here -Z and the right. Rotation and exposure are in the pixels."""
    OpenEXR = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    pixels = np.random.default_rng(3).uniform(0, 2, (8, 16, 3)).astype(np.float32)
    for environment, expected in (
        (tl.Environment.image(pixels), np.roll(pixels, 8, axis=1)),
        (tl.Environment.image(pixels, rotation=90, exposure=1), 2 * np.roll(pixels, 4, axis=1)),
    ):
        scene = dataclasses.replace(scene_of(tl.Object(box(), JADE)), environment=environment)
        path = tl.write_usd(scene, tmp_path / "stage.usda")
        assert complaints(path) == []
        stage = Usd.Stage.Open(str(path))
        dome = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Lights/environment"))
        assert dome.GetTextureFormatAttr().Get() == "latlong"
        with OpenEXR.File(str(tmp_path / dome.GetTextureFileAttr().Get().path), separate_channels=True) as read:
            held = np.stack([read.channels()[name].pixels for name in "RGB"], axis=2)
        np.testing.assert_allclose(held, expected, rtol=1e-5)
    with pytest.warns(tl.TranslucentWarning, match="a checkerboard environment belongs to the picture"):
        tl.write_usd(
            dataclasses.replace(scene, environment=tl.Environment.checkerboard((1, 1, 1), (0, 0, 0))),
            tmp_path / "b.usda",
        )
