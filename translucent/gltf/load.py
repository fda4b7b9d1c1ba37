"""Loading of a glTF file: as a scene with its cameras and lights, or whole as one mesh.

A camera's aspect ratio is left to the frame, and there are no clipping planes. Scale in its transform has no effect. A
point light's candela is read as W/sr, a directional light's lux as W/m^2: the file's number times its color, per
channel, and so is that of a spot light. `range` has no effect, since light falls off with the inverse square. Source:
glTF 2.0, section 3.10; KHR_lights_punctual.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from translucent.arguments import brief, checked_but, require_path
from translucent.arrays import Array
from translucent.errors import InputError, TranslucentWarning
from translucent.files.reading import require_room
from translucent.geometry.foreign import foreign_name, is_scene, unit_of
from translucent.geometry.mesh import MAX_COORDINATE, Mesh, Triangles, joined
from translucent.gltf.accessors import Accessors, raw_mesh
from translucent.gltf.file import COMPRESSIONS, GltfFile, JsonFields, LeftOut, gltf_of, label, read_gltf
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
from translucent.gltf.objects import UNLIT, animation_end, scene_objects
from translucent.gltf.textures import TEXTURE_TRANSFORM
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import NARROWEST_CONE, DirectionalLight, PointLight, SpotLight
from translucent.scene.scene import Light, Scene
from translucent.scene.showcase import LIGHT_TABLE, framing
from translucent.scene.touching import with_priorities
from translucent.units import metres_per_unit

SUFFIXES = (".glb", ".gltf")

LIGHTS = "KHR_lights_punctual"

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

#: A right angle in radians, and some roundings of float32.
_RIGHT_ANGLE = 0.5 * math.pi * (1.0 + 1e-6)


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
    duration : float, optional
        Seconds of the file's animations, for `time` of `load_scene`; None: it has none.
    remarks : tuple of str
        Choices that the file does not state: which body displaces another one that it touches.
    """

    left_out: tuple[str, ...] = ()
    has_camera: bool = False
    variants: tuple[str, ...] = ()
    duration: float | None = None
    remarks: tuple[str, ...] = ()


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
        Seconds on the clock of the animations at which nodes, skins and morph targets stand; see
        `translucent.gltf.nodes` and `translucent.gltf.objects`. Default: as they are written.
    draft_extensions : bool
        Whether to read KHR_materials_scatter and KHR_materials_volume_scatter, which are drafts.

    Returns
    -------
    GltfScene
        One object per node and primitive. Nodes that share a mesh share it here, too, unless a skin or morph targets
        move it; a mesh has its node's name, and a shared one its own. Meshes are welded and wound as by `load_mesh`.
        What materials make of objects says `translucent.gltf.objects`. The environment, which glTF does not have, is
        `Environment.studio`, or that of `showcase` in a file without materials.
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
    if file.items("animations") and time is None:
        left_out.add("animations", f"{len(file.items('animations'))}")
    if lost := left_out.lines():
        warnings.warn(f"scene {file.path.name!r}: left out: {'; '.join(lost)}", TranslucentWarning, stacklevel=3)
    # Surfaces mirror what is around them: that should be more than a gradient.
    polished = any(item.surface is not None for item in objects)
    environment = Environment.studio() if polished else LIGHT_TABLE
    view = own or framing(objects, size)
    variants = variant_names(file)
    scene = GltfScene(
        objects,
        view,
        lights,
        environment,
        left_out=lost,
        has_camera=own is not None,
        variants=variants,
        duration=animation_end(file),
    )
    scene, said = with_priorities(scene)
    return replace(scene, remarks=said)


def _exported(scene: Any) -> GltfFile:
    """The .glb that a scene of trimesh exports."""
    if scene.is_empty:
        raise InputError(
            f"scene {foreign_name(scene)!r}", "the scene has no geometry", "add a mesh: scene.add_geometry(mesh)"
        )
    return gltf_of(Path(foreign_name(scene)), scene.export(file_type="glb"))


def _read(path: Any, allow_outside: bool) -> GltfFile:
    require_path("load_scene path", path, "a .glb or .gltf file, or a scene of trimesh")
    if Path(path).suffix.lower() not in SUFFIXES:
        raise InputError(
            f"scene {str(path)!r}",
            f"the suffix {Path(path).suffix!r} is not that of a glTF file",
            "give a .glb or .gltf file; to read a single mesh, use tl.load_mesh",
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
                raise file.refused(f"the file requires {name}, which is not supported", do)
            left_out.add("extensions", name)


def scene_transforms(file: GltfFile, left_out: LeftOut) -> dict[int, Array]:
    """Node-to-world transforms of the nodes of the scene; raises `InputError` where one is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        world = node_transforms(file)
    transforms = {node: world[node] for node in _scene_nodes(file, left_out)}
    for node, matrix in transforms.items():
        if not (np.abs(matrix) <= MAX_COORDINATE).all():
            where = f"node {label(file.items('nodes'), node)}"
            raise file.refused(f"{where}: the transform has values beyond {MAX_COORDINATE:g}", "export the file again")
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
                require_room(f"glTF {str(path)!r}", "all placed parts together", size, file.stored, "split the file")
                parts.append(_placed(mesh, matrix))
    if not parts:
        raise file.refused("the file has no faces", "give a triangle mesh, not points or lines")
    return joined(parts, f"glTF {str(path)!r}")


def _placed(mesh: Mesh, matrix: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Triangles:
    """Place a part in the world; a mirrored one is rewound so that its outside stays outside."""
    if (matrix == np.eye(4)).all():
        return mesh.vertices, mesh.faces, mesh.uv
    faces = mesh.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
    return mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], faces, mesh.uv


def scene_camera(
    file: GltfFile, transforms: dict[int, Array], index: int | None, metres: float, left_out: LeftOut
) -> Camera | None:
    """Camera of this index; None if none is requested, or if the first is requested and the file has none.

    Parameters
    ----------
    file : GltfFile
    transforms : dict
        Node to world (4x4) of the nodes of the scene.
    index : int or None
        Among the cameras that nodes of the scene place, in the order of the file's list of cameras.
    metres : float
        Per unit of the file.
    left_out : LeftOut
        Gets what the camera does not hold.

    Raises
    ------
    InputError
        If there is no such camera, it is wrong, or its node's transform is singular.
    """
    nodes, cameras = file.items("nodes"), file.items("cameras")
    placed = []
    for node in transforms:
        if "camera" in nodes[node]:
            file.item("cameras", nodes[node]["camera"])
            placed.append((nodes[node]["camera"], node))
    placed.sort()
    if index is None or (isinstance(index, int) and index == 0 and not placed):
        return None
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(placed):
        listed = ", ".join(f"{i} of node {label(nodes, node)}" for i, (_, node) in enumerate(placed))
        raise InputError(
            f"camera {brief(index)} of {str(file.path)!r}",
            f"the file has {listed}" if placed else "the file has no cameras",
            "use one of these camera numbers" if placed else "omit the camera: the view then shows all objects",
        )
    camera, node = placed[index]
    where = f"camera {label(cameras, camera)} of node {label(nodes, node)}"
    matrix = transforms[node]
    pose = np.eye(4)
    pose[:3, :3] = _axes(file, where, matrix[:3, :3])
    pose[:3, 3] = matrix[:3, 3] * metres
    if np.linalg.det(matrix[:3, :3] / np.abs(matrix[:3, :3]).max()) < 0:
        left_out.add("mirroring cameras", label(nodes, node))
    return _camera(JsonFields(file, where, cameras[camera]), pose, metres)


def _axes(file: GltfFile, where: str, linear: Array) -> Array:
    """Right, up and backward as columns: the view is along the node's -Z, with its +Y upwards, whatever its scale."""
    require_regular(file, where, linear)
    y, z = (linear[:, i] / np.abs(linear[:, i]).max() for i in (1, 2))
    backward = z / np.linalg.norm(z)
    right = np.cross(y / np.linalg.norm(y), backward)
    right /= np.linalg.norm(right)
    return np.column_stack([right, np.cross(backward, right), backward])


def require_regular(file: GltfFile, where: str, linear: Array) -> None:
    """Raise `InputError` if a transform (3, 3) is singular."""
    if np.linalg.matrix_rank(linear) < 3:
        raise file.refused(
            f"{where}: the transform is singular (this node, or a node above, has a scale of 0)",
            "use a scale other than 0 along every axis",
        )


def _camera(fields: JsonFields, pose: Array, metres: float) -> Camera:
    kind = fields.values.get("type")
    if kind == "perspective":
        angle = math.degrees(fields.section(kind).number("yfov"))
        if not 0 < angle < 180:
            fields.refuse(f"yfov of {angle:g} degrees is not between 0 and 180", "correct the file")
        return Camera(pose, fov_y=angle)
    if kind == "orthographic":
        return Camera(pose, fov_y=None, height=2.0 * metres * fields.section(kind).number("ymag", low=0.0, above=True))
    raise fields.file.refused(f"{fields.where}: type {kind!r} is neither perspective nor orthographic")


def scene_lights(file: GltfFile, transforms: dict[int, Array], metres: float, left_out: LeftOut) -> list[Light]:
    """The lights of a scene.

    Parameters
    ----------
    file : GltfFile
    transforms : dict
        Node to world (4x4) of the nodes of the scene.
    metres : float
        Per unit of the file. Intensities change with its square, so that the light on the objects is the same.
    left_out : LeftOut
        Gets what the lights do not hold.

    Raises
    ------
    InputError
        If a light is wrong, or its node's transform is singular.
    """
    nodes = file.items("nodes")
    listed = JsonFields(file, "the file", file.tree).extension(LIGHTS).values.get("lights", [])
    found: list[Light] = []
    for node, matrix in transforms.items():
        name = label(nodes, node)
        where = f"light of node {name}"
        if not (placed := JsonFields(file, where, nodes[node]).extension(LIGHTS).values):
            continue
        index = placed.get("light")
        if not isinstance(listed, list) or isinstance(index, bool) or not isinstance(index, int):
            raise file.refused(f"{where}: the light index {index!r} is not a whole number, or the file has no lights")
        if not 0 <= index < len(listed) or not isinstance(listed[index], dict):
            raise file.refused(f"{where}: light {index} does not exist: the file has {len(listed)} lights")
        require_regular(file, where, matrix[:3, :3])
        light = listed[index]
        if "range" in light and light.get("type") != "directional":
            left_out.add("ranges of lights", name)
        found.append(_light(JsonFields(file, where, light), matrix, metres))
    return found


def _light(fields: JsonFields, matrix: Array, metres: float) -> Light:
    color = np.array(fields.numbers("color", (1.0, 1.0, 1.0)))
    strength = fields.number("intensity", 1.0)
    if strength < 0 or (color < 0).any():
        fields.refuse(f"the intensity {strength:g} or the color {color.tolist()} is below 0", "correct the file")
    kind = fields.values.get("type")
    if kind not in ("point", "directional", "spot"):
        fields.refuse(f"the type {kind!r} is not point, directional or spot")
    if kind == "directional":
        return DirectionalLight(-matrix[:3, 2], strength * color)
    position, intensity = matrix[:3, 3] * metres, strength * color * metres**2
    if kind == "point":
        return PointLight(position, intensity)
    return SpotLight(position, -matrix[:3, 2], intensity, *_cones(fields.section("spot")))


def _cones(spot: JsonFields) -> tuple[float, float]:
    """Half angles of the inner and the outer cone in degrees."""
    inner, outer = spot.number("innerConeAngle", 0.0), spot.number("outerConeAngle", math.pi / 4.0)
    # A right angle of float32 is a little more.
    degrees = math.degrees(inner), min(math.degrees(outer), 90.0) if outer < _RIGHT_ANGLE else math.degrees(outer)
    if not (0.0 <= degrees[0] < degrees[1] <= 90.0 and degrees[1] >= NARROWEST_CONE):
        found = f"innerConeAngle {inner:g} and outerConeAngle {outer:g} must satisfy 0 <= inner < outer <= pi / 2"
        spot.refuse(found, "correct the file")
    return degrees
