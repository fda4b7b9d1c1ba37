"""Loading of a glTF file: as a scene, or whole as one mesh."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arguments import checked_but, require_path
from translucent.arrays import Array
from translucent.errors import InputError, TranslucentWarning
from translucent.files.reading import require_room
from translucent.geometry.foreign import foreign_name, is_scene, unit_of
from translucent.geometry.mesh import MAX_COORDINATE, Mesh, Triangles, joined
from translucent.gltf.accessors import Accessors, raw_mesh
from translucent.gltf.file import COMPRESSIONS, GltfFile, LeftOut, gltf_of, label, read_gltf
from translucent.gltf.lights import LIGHTS, scene_camera, scene_lights
from translucent.gltf.materials import (
    CLEARCOAT,
    DIFFUSE_TRANSMISSION,
    DISPERSION,
    DRAFTS,
    EMISSIVE_STRENGTH,
    IOR,
    IRIDESCENCE,
    TRANSMISSION,
    VOLUME,
)
from translucent.gltf.nodes import VARIANTS, node_transforms, posed, primitives, variant_names
from translucent.gltf.objects import UNLIT, scene_objects
from translucent.gltf.textures import TEXTURE_TRANSFORM
from translucent.scene.environment import Environment
from translucent.scene.scene import Scene
from translucent.scene.showcase import LIGHT_TABLE, framing
from translucent.units import metres_per_unit

SUFFIXES = (".glb", ".gltf")

#: Extensions that are read; parts of them that a scene cannot hold are reported one by one.
_READ = (
    TRANSMISSION,
    VOLUME,
    IOR,
    DISPERSION,
    DIFFUSE_TRANSMISSION,
    EMISSIVE_STRENGTH,
    IRIDESCENCE,
    CLEARCOAT,
    UNLIT,
    TEXTURE_TRANSFORM,
    LIGHTS,
    VARIANTS,
    "KHR_mesh_quantization",
)
#: Extensions that a file may require and that can be ignored: they only change the look of surfaces and textures.
_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_")


@dataclass(frozen=True, eq=False, repr=False)
class GltfScene(Scene):
    """Scene read from a glTF file.

    Parameters
    ----------
    left_out : tuple of str
        Features of the file that the scene does not hold, one line per kind with the names that have it.
    has_camera : bool
        Whether the camera is one of the file's, rather than one that frames all objects.
    variants : tuple of str
        Names of the file's variants of materials, for `variant` of `load_scene`.
    """

    left_out: tuple[str, ...] = ()
    has_camera: bool = False
    variants: tuple[str, ...] = ()


@checked_but("path", "camera", "size")
def load_scene(
    path: Any,
    unit: str | None = None,
    camera: int | None = 0,
    size: tuple[int, int] = (1, 1),
    *,
    allow_outside: bool = False,
    variant: str | None = None,
    time: float | None = None,
    draft_extensions: bool = False,
) -> GltfScene:
    """Read a scene from a .gltf or .glb file: its objects with their media, one camera, and its lights.

    Parameters
    ----------
    path : path or trimesh.Scene
        A glTF 2.0 file. Its default scene is read, or else its first. A scene of trimesh is what it exports as .glb.
    unit : str, optional
        Unit of the file's lengths. glTF is in metres by definition; another unit rescales the whole, attenuation
        distances and lights included, so that it looks the same. Default: metres, and for a scene of trimesh its units.
    camera : int or None
        Which of the cameras that nodes place, counted from 0. None frames all objects, and so does 0 in a file without
        cameras.
    size : (width, height)
        Size of the picture in pixels, which the framing depends on; a wider picture shows all objects, too.
    allow_outside : bool
        Whether buffers and images may lie outside the file's folder: only for files that you trust.
    variant : str, optional
        Name of a variant of materials (KHR_materials_variants). Default: the materials that primitives have themselves.
    time : float, optional
        Seconds on the clock of the animations at which nodes stand; see `translucent.gltf.nodes`. Default: as the
        nodes are written. Skins and morph targets are left out, whatever the time.
    draft_extensions : bool
        Whether to read KHR_materials_scatter and KHR_materials_volume_scatter, which are drafts.

    Returns
    -------
    GltfScene
        One object per node and primitive. Nodes that share a mesh share it here, too; a mesh has its node's name, and a
        shared one its own. Meshes are welded and wound as by `load_mesh`. What materials make of objects says
        `translucent.gltf.objects`. The environment, which glTF does not have, is `Environment.studio`, or that of
        `showcase` in a file without materials.
        `left_out` lists what the scene does not hold, and a `TranslucentWarning` reports it.

    Raises
    ------
    InputError
        If the file is missing, broken, no glTF, compressed or without triangles; if a value in it is wrong, or the
        transform of a light or of the camera is singular; if there is no such camera, variant or animation.
    """
    if is_scene(path):
        metres, file = unit_of(path, unit)[0], _exported(path)
    else:
        metres, file = metres_per_unit("m" if unit is None else unit), _read(path, allow_outside)
    left_out = LeftOut()
    check_extensions(file, left_out, DRAFTS.values() if draft_extensions else ())
    if time is not None:
        file = posed(file, time, left_out)
    with np.errstate(under="ignore"):
        transforms = scene_transforms(file, left_out)
        objects = scene_objects(file, transforms, metres, left_out, draft_extensions, variant)
        own = scene_camera(file, transforms, camera, metres, left_out)
        lights = scene_lights(file, transforms, metres, left_out)
    for key in ("animations", "skins"):
        if file.items(key) and not (key == "animations" and time is not None):
            left_out.add(key, f"{len(file.items(key))}")
    if lost := left_out.lines():
        warnings.warn(f"scene {file.path.name!r}: left out: {'; '.join(lost)}", TranslucentWarning, stacklevel=3)
    # Surfaces mirror what is around them: that should be more than a gradient.
    polished = any(item.surface is not None for item in objects)
    environment = Environment.studio() if polished else LIGHT_TABLE
    view = own or framing(objects, size)
    variants = variant_names(file)
    return GltfScene(objects, view, lights, environment, left_out=lost, has_camera=own is not None, variants=variants)


def _exported(scene: Any) -> GltfFile:
    """The .glb that a scene of trimesh exports."""
    if scene.is_empty:
        raise InputError(f"scene {foreign_name(scene)!r}", "it has no geometry", "add some: scene.add_geometry(mesh)")
    return gltf_of(Path(foreign_name(scene)), scene.export(file_type="glb"))


def _read(path: Any, allow_outside: bool) -> GltfFile:
    require_path("load_scene path", path, "a .glb or .gltf file, or a scene of trimesh")
    if Path(path).suffix.lower() not in SUFFIXES:
        raise InputError(
            f"scene {str(path)!r}",
            f"suffix {Path(path).suffix!r}, and scenes are glTF files",
            "give a .glb or .gltf file, or read a mesh with tl.load_mesh",
        )
    return read_gltf(path, allow_outside)


def check_extensions(file: GltfFile, left_out: LeftOut, known: Collection[str] = ()) -> None:
    """Refuse a file with unsupported required extensions, and record the ones that it merely uses; not the `known`."""
    for key in ("extensionsRequired", "extensionsUsed"):
        names = file.tree.get(key, [])
        if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
            raise file.refused(f"{key} is {names!r}, not a list of names")
        for name in names:
            if name in _READ or name in known:
                continue
            if key == "extensionsRequired" and not name.startswith(_LOOKS):
                do = "export it without compression" if name in COMPRESSIONS else "export it without this extension"
                raise file.refused(f"it requires {name}, which is not supported", do)
            left_out.add("extensions", name)


def scene_transforms(file: GltfFile, left_out: LeftOut) -> dict[int, Array]:
    """Node-to-world transforms of the nodes of the scene; raises `InputError` where one is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        world = node_transforms(file)
    transforms = {node: world[node] for node in _scene_nodes(file, left_out)}
    for node, matrix in transforms.items():
        if not (np.abs(matrix) <= MAX_COORDINATE).all():
            where = f"node {label(file.items('nodes'), node)}"
            raise file.refused(f"{where}: its transform exceeds {MAX_COORDINATE:g}", "export the file again")
    return transforms


def _scene_nodes(file: GltfFile, left_out: LeftOut) -> Iterator[int]:
    """The nodes of the default scene, parents first, in the file's order; without scenes, all nodes."""
    nodes, scenes = file.items("nodes"), file.items("scenes")
    if not scenes and "scene" not in file.tree:
        yield from range(len(nodes))
        return
    chosen = file.tree.get("scene", 0)
    roots = file.item("scenes", chosen).get("nodes", [])
    if not isinstance(roots, list):
        raise file.refused(f"scene {chosen}: nodes is {roots!r}, not a list")
    for i in range(len(scenes)):
        if i != chosen:
            left_out.add("other scenes", label(scenes, i))
    pending, visited = roots[::-1], set()
    while pending:
        index = pending.pop()
        node = file.item("nodes", index)
        if index in visited:
            continue
        visited.add(index)
        yield index
        pending += node.get("children", [])[::-1]


def read_whole(path: Path, allow_outside: bool = False) -> Triangles:
    """Read vertices, faces and, if all parts have them, texture coordinates of the default scene, in the file's unit.

    Raises
    ------
    InputError
        If the file is broken, compressed or without triangles.
    """
    file = read_gltf(path, allow_outside)
    left_out = LeftOut()  # of looks, which a mesh has none of
    check_extensions(file, left_out)
    accessors, size = Accessors(file), 0
    meshes: dict[int, list[Mesh | None]] = {}
    parts: list[Triangles] = []
    with np.errstate(under="ignore"):
        for node, matrix in scene_transforms(file, left_out).items():
            index = file.items("nodes")[node].get("mesh")
            if index is None or not matrix[:3, :3].any():
                continue
            entry = file.item("meshes", index)
            if index not in meshes:
                listed = primitives(file, entry)
                meshes[index] = [raw_mesh(accessors, primitive, f"mesh {index}") for primitive in listed]
            for mesh in filter(None, meshes[index]):
                size += 4 * (mesh.vertices.nbytes + mesh.faces.nbytes)  # until they are one mesh
                require_room(f"glTF {str(path)!r}", "its parts in all places", size, file.stored, "split the file")
                parts.append(_placed(mesh, matrix))
    if not parts:
        raise file.refused("it has no faces", "give a triangle mesh, not points or lines")
    return joined(parts, f"glTF {str(path)!r}")


def _placed(mesh: Mesh, matrix: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Triangles:
    """Place a part in the world; a mirrored one is rewound so that its outside stays outside."""
    if (matrix == np.eye(4)).all():
        return mesh.vertices, mesh.faces, mesh.uv
    faces = mesh.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
    return mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], faces, mesh.uv
