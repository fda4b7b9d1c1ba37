"""USD stages: geometry with transforms, OpenPBR materials, and thickness per vertex as ``primvars:thickness``.

A mesh has its triangles, normals for shading at the corners of its faces, texture coordinates ``primvars:st``, and
thickness in metres, in its own space: a transform that scales an object scales it, too, as in glTF. Lengths are in
metres (``metersPerUnit = 1``), +Y is up. A material is a MaterialX network of one node,
``ND_open_pbr_surface_surfaceshader``, with the inputs of `translucent.materials.materialx`, since UsdPreviewSurface has
neither transmission nor volume.

Not written: camera, lights, environment, textures, coats, films, dispersion, and media that emit or vary in density;
a warning names the objects that have one of them.
Source: OpenUSD, UsdGeom (stage metrics, primvars), UsdShade.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arguments import checked
from translucent.arrays import Floats
from translucent.bake.thickness_map import VertexThickness
from translucent.errors import InputError, TranslucentWarning
from translucent.extras import require_package
from translucent.files.paths import require_output, write_atomically
from translucent.geometry.normals import corner_normals
from translucent.materials.materialx import OPENPBR, transmission_inputs
from translucent.scene.scene import Object, Scene, object_names
from translucent.scene.surface import Surface

#: Files that it writes.
USD_SUFFIXES = (".usda", ".usdc", ".usd")


@checked
def write_usd(scene: Scene, path: str | Path, thickness: Sequence[VertexThickness] = ()) -> Path:
    """Write a scene as a USD stage: meshes, materials, and thickness per vertex.

    Parameters
    ----------
    scene : Scene
        Its objects are written, and not its camera, lights and environment.
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
            raise InputError(f"thickness of {baked.mesh.name!r}", "no object of the scene has this mesh", do)
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
        taken = {"Looks"}
        for item in scene.objects:
            name = tf.MakeValidIdentifier(Path(item.mesh.name).stem or "object")
            while name in taken:
                name += "_"
            taken.add(name)
            values = next((baked.values for baked in thickness if baked.mesh is item.mesh), None)
            mesh = _add_mesh(stage, f"/World/{name}", item, values)
            _add_material(stage, f"/World/Looks/{name}", item, mesh)
        stage.GetRootLayer().Save()
        content = made.read_bytes()

    def fill(place: Path) -> None:
        place.write_bytes(content)

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
    """Modules of OpenUSD, whose package is there."""
    return [import_module(f"pxr.{name}") for name in names]


def _add_mesh(stage: Any, path: str, item: Object, thickness: Floats | None) -> Any:
    """Mesh of an object where it is in the scene."""
    geom, gf, sdf, vt = _pxr("UsdGeom", "Gf", "Sdf", "Vt")
    mesh, found = item.mesh, geom.Mesh.Define(stage, path)
    if not np.abs(mesh.bounds).max() < np.finfo(np.float32).max:
        raise InputError(f"mesh {mesh.name!r}", "coordinates beyond float32, which USD has", "scale the mesh")
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


def _add_material(stage: Any, path: str, item: Object, mesh: Any) -> None:
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


def _left_out(scene: Scene) -> list[tuple[list[Object], str]]:
    """Objects with what a stage here does not hold."""
    default = Surface()
    groups = [
        ([item for item in scene.objects if item.density is not None], "densities that vary"),
        ([item for item in scene.objects if item.medium is not None and item.medium.emits], "media that emit"),
        ([item for item in scene.objects if item.surface is not None and any(item.surface.textures)], "textures"),
        ([item for item in scene.objects if item.mesh.colors is not None], "colors of vertices"),
    ]
    for name in ("clearcoat", "iridescence", "dispersion"):
        some = [
            item for item in scene.objects if item.surface and getattr(item.surface, name) != getattr(default, name)
        ]
        groups.append((some, f"{name} of surfaces"))
    return [(items, found) for items, found in groups if items]
