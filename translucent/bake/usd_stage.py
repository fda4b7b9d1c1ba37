"""USD stages: geometry, OpenPBR materials, camera and lights, and thickness per vertex as ``primvars:thickness``.

A mesh has its triangles, normals for shading at the corners of its faces, texture coordinates ``primvars:st``, and
thickness in metres, in its own space: a transform that scales an object scales it, too, as in glTF. Lengths are in
metres (``metersPerUnit = 1``), +Y is up. A material is a MaterialX network around the node
``ND_open_pbr_surface_surfaceshader``, with the inputs of `translucent.materials.materialx`, since UsdPreviewSurface has
neither transmission nor volume. Textures of base colors lie beside the stage, in linear values (``name.0.exr``).

Lights have the units of UsdLux with ``normalize``: a sphere, or a point, of an intensity I in W/sr has 4 I there, since
of its surface 4 pi r^2 one side shows pi r^2; a distant light of the angle 0 has its irradiance.

An environment is a dome. A gradient or a picture lies beside the stage (``name.environment.exr``), with directions as
OpenEXR maps them, which UsdLux asks for.

Not written: checkerboards, other textures, coats, films, dispersion, and media that emit or vary in density; a warning
names them.
Source: OpenUSD, UsdGeom (stage metrics, primvars, cameras), UsdLux (normalize), UsdShade.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Array, Floats
from translucent.bake.thickness_map import VertexThickness
from translucent.errors import InputError, TranslucentWarning
from translucent.extras import require_package
from translucent.files.images import write_exr
from translucent.files.paths import require_output, write_atomically
from translucent.geometry.normals import corner_normals
from translucent.materials.materialx import OPENPBR, transmission_inputs
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, SphereLight, SpotLight
from translucent.scene.scene import Object, Scene, object_names
from translucent.scene.surface import Surface
from translucent.scene.texture import Texture

#: Rows of the picture of a gradient.
_SKY_ROWS = 64

#: Files that it writes.
USD_SUFFIXES = (".usda", ".usdc", ".usd")


@checked
def write_usd(scene: Scene, path: str | Path, thickness: Sequence[VertexThickness] = ()) -> Path:
    """Write a scene as a USD stage: meshes, materials, and thickness per vertex.

    Parameters
    ----------
    scene : Scene
        Its objects, camera, lights and environment.
    path : path
        A .usda (text), .usdc or .usd file.
    thickness : sequence of VertexThickness
        Bakes of meshes of the scene, by `bake_vertex_thickness`, in any order.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the suffix is another one, a bake is of no mesh of the scene, or coordinates are beyond float32.
    RenderError
        If usd-core is not installed, or the file cannot be written.

    Warns
    -----
    TranslucentWarning
        If objects have properties that are not written.
    """
    path = Path(path)
    check_usd_output(path)
    for baked in thickness:
        if not any(item.mesh is baked.mesh for item in scene.objects):
            do = "bake the meshes of the scene: bake_vertex_thickness(scene.objects[0].mesh)"
            raise InputError(f"thickness of {baked.mesh.name!r}", "the scene has no object with this mesh", do)
    for items, found in _left_out(scene):
        warnings.warn(f"{object_names(items)}: {found}, which are not written", TranslucentWarning, stacklevel=3)
    usd, geom, tf = _pxr("Usd", "UsdGeom", "Tf")
    with tempfile.TemporaryDirectory() as folder:
        # OpenUSD takes the format from the suffix, which the names of temporary files beside the output may lack.
        made = Path(folder) / f"stage{path.suffix.lower()}"
        stage = usd.Stage.CreateNew(str(made))
        geom.SetStageMetersPerUnit(stage, 1.0)
        geom.SetStageUpAxis(stage, geom.Tokens.y)
        root = geom.Xform.Define(stage, "/World")
        stage.SetDefaultPrim(root.GetPrim())
        geom.Scope.Define(stage, "/World/Looks")
        taken, pictures = {"Looks", "Camera", "Lights"}, dict[Path, Array]()
        for item in scene.objects:
            name = tf.MakeValidIdentifier(Path(item.mesh.name).stem or "object")
            while name in taken:
                name += "_"
            taken.add(name)
            values = next((baked.values for baked in thickness if baked.mesh is item.mesh), None)
            mesh = _add_mesh(stage, f"/World/{name}", item, values)
            material = _add_material(stage, f"/World/Looks/{name}", item, mesh)
            if (texture := _base_texture(item)) is not None:
                file = path.with_name(f"{path.stem}.{len(pictures)}.exr")
                pictures[file] = np.asarray(texture.pixels, np.float64)[..., :3]
                _add_texture(stage, material, item, mesh, f"./{file.name}")
        _add_camera(stage, scene)
        _add_lights(stage, scene)
        if scene.environment.kind in ("gradient", "image"):
            file = path.with_name(f"{path.stem}.environment.exr")
            pictures[file] = _sky(scene.environment)
            dome = _pxr("UsdLux")[0].DomeLight.Define(stage, "/World/Lights/environment")
            dome.CreateTextureFileAttr(f"./{file.name}")
            dome.CreateTextureFormatAttr("latlong")
        stage.GetRootLayer().Save()
        content = made.read_bytes()

    def fill(place: Path) -> None:
        place.write_bytes(content)

    for file, pixels in pictures.items():
        channels = dict(zip("RGB", np.moveaxis(pixels.astype(np.float32), 2, 0), strict=True))
        write_atomically(file, partial(write_exr, channels=channels, header={}))
    write_atomically(path, fill)
    return path


def check_usd_output(path: Path) -> None:
    """Raise an error before any work is done if no stage can be written to the path."""
    requested = f"USD stage {str(path)!r}"
    if path.suffix.lower() not in USD_SUFFIXES:
        raise InputError(requested, f"suffix {path.suffix!r}", f"use {', '.join(USD_SUFFIXES)}")
    require_output(path, requested)
    require_package("pxr", requested)


def _pxr(*names: str) -> list[Any]:
    """Modules of OpenUSD; its package must be installed."""
    return [import_module(f"pxr.{name}") for name in names]


def _add_mesh(stage: Any, path: str, item: Object, thickness: Floats | None) -> Any:
    """Mesh of an object where it is in the scene."""
    geom, gf, sdf, vt = _pxr("UsdGeom", "Gf", "Sdf", "Vt")
    mesh, found = item.mesh, geom.Mesh.Define(stage, path)
    if not np.abs(mesh.bounds).max() < np.finfo(np.float32).max:
        raise InputError(
            f"mesh {mesh.name!r}", "some coordinates are too large for the float32 numbers of USD", "scale the mesh"
        )
    with np.errstate(under="ignore"):
        points = mesh.vertices.astype(np.float32)
    # USD multiplies rows by matrices.
    found.AddTransformOp().Set(gf.Matrix4d(item.matrix.T.tolist()))
    found.CreatePointsAttr(vt.Vec3fArray.FromNumpy(points))
    found.CreateExtentAttr(vt.Vec3fArray.FromNumpy(mesh.bounds.astype(np.float32)))
    found.CreateFaceVertexCountsAttr(vt.IntArray.FromNumpy(np.full(len(mesh.faces), 3, np.int32)))
    found.CreateFaceVertexIndicesAttr(vt.IntArray.FromNumpy(mesh.faces.reshape(-1)))
    found.CreateSubdivisionSchemeAttr(geom.Tokens.none)
    inverted = mesh.diagnosis.inverted
    found.CreateOrientationAttr(geom.Tokens.leftHanded if inverted else geom.Tokens.rightHanded)
    found.CreateDoubleSidedAttr(item.surface is None or item.surface.double_sided)
    normals = corner_normals(mesh).reshape(-1, 3) * (-1.0 if inverted else 1.0)
    with np.errstate(under="ignore"):
        found.CreateNormalsAttr(vt.Vec3fArray.FromNumpy(normals.astype(np.float32)))
    found.SetNormalsInterpolation(geom.Tokens.faceVarying)
    primvars = geom.PrimvarsAPI(found)
    if mesh.uv is not None:
        st = primvars.CreatePrimvar("st", sdf.ValueTypeNames.TexCoord2fArray, geom.Tokens.vertex)
        st.Set(vt.Vec2fArray.FromNumpy(mesh.uv.astype(np.float32)))
    if thickness is not None:
        held = primvars.CreatePrimvar("thickness", sdf.ValueTypeNames.FloatArray, geom.Tokens.vertex)
        held.Set(vt.FloatArray.FromNumpy(thickness))
        held.GetAttr().SetDocumentation("Thickness in metres, in the space of the mesh.")
    return found


def _add_material(stage: Any, path: str, item: Object, mesh: Any) -> Any:
    """OpenPBR surface of an object, bound to its mesh."""
    shade, sdf = _pxr("UsdShade", "Sdf")
    types, surface = sdf.ValueTypeNames, item.surface
    if item.medium is not None:
        inputs = transmission_inputs(OPENPBR, item.medium, roughness=0.0 if surface is None else surface.roughness)
    else:
        plain = Surface(ior=1.0, roughness=1.0) if surface is None else surface
        inputs = {
            "base_color": item.base_color,
            "base_metalness": plain.metallic,
            OPENPBR.ior: plain.ior,
            OPENPBR.roughness: plain.roughness,
        }
    material = shade.Material.Define(stage, path)
    shader = shade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr(f"ND_{OPENPBR.node}_surfaceshader")
    for key, value in inputs.items():
        if np.ndim(value):
            shader.CreateInput(key, types.Color3f).Set(tuple(np.asarray(value, np.float64).tolist()))
        else:
            shader.CreateInput(key, types.Float).Set(float(value))
    if item.sheet_thickness is not None:
        shader.CreateInput("geometry_thin_walled", types.Bool).Set(True)
    material.CreateSurfaceOutput("mtlx").ConnectToSource(shader.CreateOutput("out", types.Token))
    shade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    return material


def _base_texture(item: Object) -> Texture | None:
    """Base color texture of an opaque object."""
    known = item.medium is None and item.surface is not None and item.mesh.uv is not None
    return item.surface.color_texture if known and item.surface is not None else None


def _add_texture(stage: Any, material: Any, item: Object, mesh: Any, file: str) -> None:
    """Base color times a picture, looked up at coordinates that the mesh has for it."""
    geom, shade, sdf, vt = _pxr("UsdGeom", "UsdShade", "Sdf", "Vt")
    types, texture, path = sdf.ValueTypeNames, _base_texture(item), material.GetPath()
    assert texture is not None
    assert item.mesh.uv is not None
    placed = item.mesh.uv @ texture.rows[:, :2].T + texture.rows[:, 2]
    held = geom.PrimvarsAPI(mesh).CreatePrimvar("st_color", types.TexCoord2fArray, geom.Tokens.vertex)
    held.Set(vt.Vec2fArray.FromNumpy(placed.astype(np.float32)))
    place = shade.Shader.Define(stage, f"{path}/place")
    place.CreateIdAttr("ND_geompropvalue_vector2")
    place.CreateInput("geomprop", types.String).Set("st_color")
    picture = shade.Shader.Define(stage, f"{path}/picture")
    picture.CreateIdAttr("ND_image_color3")
    picture.CreateInput("file", types.Asset).Set(file)
    for axis, wrap in zip("uv", texture.wrap, strict=True):
        picture.CreateInput(f"{axis}addressmode", types.String).Set("periodic" if wrap == "repeat" else "clamp")
    picture.CreateInput("texcoord", types.Float2).ConnectToSource(place.CreateOutput("out", types.Float2))
    product = shade.Shader.Define(stage, f"{path}/color")
    product.CreateIdAttr("ND_multiply_color3")
    product.CreateInput("in1", types.Color3f).ConnectToSource(picture.CreateOutput("out", types.Color3f))
    color = shade.Shader.Get(stage, f"{path}/surface").GetInput("base_color")
    product.CreateInput("in2", types.Color3f).Set(color.Get())
    color.GetAttr().Clear()
    color.ConnectToSource(product.CreateOutput("out", types.Color3f))


def _frame(position: Array, direction: Array) -> Array:
    """(4, 4): pose at a position whose -Z is a direction."""
    back = -direction / np.linalg.norm(direction)
    right = np.cross((0.0, 1.0, 0.0) if abs(back[1]) < 0.9 else (1.0, 0.0, 0.0), back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.column_stack([right, np.cross(back, right), back, position])
    return pose


def _add_camera(stage: Any, scene: Scene) -> None:
    """Camera with a picture of 3:2: renderers keep its height, or its width, for others."""
    geom, gf = _pxr("UsdGeom", "Gf")
    camera, found = scene.camera, geom.Camera.Define(stage, "/World/Camera")
    found.AddTransformOp().Set(gf.Matrix4d(np.asarray(camera.pose, np.float64).T.tolist()))
    # Apertures and focal lengths are in tenths of a unit.
    high = 0.24 if camera.height is None else 10.0 * camera.height
    found.CreateVerticalApertureAttr(high)
    found.CreateHorizontalApertureAttr(1.5 * high)
    if camera.fov_y is None:
        found.CreateProjectionAttr(geom.Tokens.orthographic)
    else:
        found.CreateFocalLengthAttr(0.5 * high / float(np.tan(np.radians(0.5 * camera.fov_y))))
    far = float(np.linalg.norm(scene.bounds - camera.eye, axis=1).max()) + scene.diagonal
    found.CreateClippingRangeAttr(gf.Vec2f(1e-4 * far, 2.0 * far))


def _add_lights(stage: Any, scene: Scene) -> None:
    """Lights, and a dome for an environment that is the same everywhere."""
    geom, lux, gf = _pxr("UsdGeom", "UsdLux", "Gf")
    geom.Scope.Define(stage, "/World/Lights")
    for i, light in enumerate(scene.lights):
        path = f"/World/Lights/light_{i}"
        if isinstance(light, DirectionalLight):
            found, power = lux.DistantLight.Define(stage, path), np.asarray(light.irradiance)
            found.CreateAngleAttr(0.0)
            pose = _frame(np.zeros(3), np.asarray(light.direction, np.float64))
        else:
            found, power = lux.SphereLight.Define(stage, path), 4.0 * np.asarray(light.intensity)
            direction = np.asarray(getattr(light, "direction", (0.0, 0.0, -1.0)), np.float64)
            pose = _frame(np.asarray(light.position, np.float64), direction)
            found.CreateRadiusAttr(light.radius if isinstance(light, SphereLight) else 1e-4 * scene.diagonal)
            if not isinstance(light, SphereLight):
                found.CreateTreatAsPointAttr(True)
            if isinstance(light, SpotLight):
                shaping = lux.ShapingAPI.Apply(found.GetPrim())
                shaping.CreateShapingConeAngleAttr(light.outer_cone)
                shaping.CreateShapingConeSoftnessAttr(1.0 - light.inner_cone / light.outer_cone)
        found.CreateNormalizeAttr(True)
        _shine(found, power)
        found.AddTransformOp().Set(gf.Matrix4d(pose.T.tolist()))
    radiance = scene.environment.first * 2.0**scene.environment.exposure
    if scene.environment.kind == "constant" and radiance.any():
        _shine(lux.DomeLight.Define(stage, "/World/Lights/environment"), radiance)


def _sky(environment: Environment) -> Array:
    """Radiance (h, 2 h, 3) of all directions as OpenEXR maps them: +Y up, +Z in the middle, +X to the left of it."""
    rows = _SKY_ROWS if environment.map is None else environment.map.pixels.shape[0]
    polar = (np.arange(rows) + 0.5)[:, None] * np.pi / rows
    longitude = np.pi - (np.arange(2 * rows) + 0.5) * np.pi / rows
    across = np.sin(polar)
    directions = (
        across * np.sin(longitude),
        np.broadcast_to(np.cos(polar), (rows, 2 * rows)),
        across * np.cos(longitude),
    )
    return environment.lighting(np.stack(directions, axis=-1))


def _shine(light: Any, power: Array) -> None:
    """Set the intensity and the normalized color of a light."""
    (gf,) = _pxr("Gf")
    most = float(power.max()) or 1.0
    light.CreateIntensityAttr(most)
    light.CreateColorAttr(gf.Vec3f(*(power / most).tolist()))


def _left_out(scene: Scene) -> list[tuple[list[Object], str]]:
    """Groups of objects with a feature that the USD stage cannot store."""
    default = Surface()
    if scene.environment.kind == "checkerboard":
        found = "a checkerboard environment belongs to the picture, and a USD dome light surrounds the scene"
        warnings.warn(f"{found}; it is not written", TranslucentWarning, stacklevel=4)
    groups = [
        ([item for item in scene.objects if item.density is not None], "varying densities"),
        ([item for item in scene.objects if item.medium is not None and item.medium.emits], "media that emit light"),
        ([item for item in scene.objects if _other_textures(item)], "textures other than base colors"),
        ([item for item in scene.objects if item.mesh.colors is not None], "vertex colors"),
    ]
    for name in ("clearcoat", "iridescence", "dispersion"):
        some = [
            item for item in scene.objects if item.surface and getattr(item.surface, name) != getattr(default, name)
        ]
        groups.append((some, f"{name} of surfaces"))
    return [(items, found) for items, found in groups if items]


def _other_textures(item: Object) -> bool:
    if item.surface is None:
        return False
    return any(one is not None and one is not _base_texture(item) for one in item.surface.textures)
