"""Conversion of pyrender's scenes to scenes of the toolkit. Import it by the shim only."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
import pyrender

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh, mended
from translucent.interop._pyrender_pictures import GAMMA
from translucent.media.medium import Medium
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.lights import DirectionalLight, PointLight, SpotLight
from translucent.scene.scene import Light, Object, Overlap, Scene

#: A camera whose optical center is off the middle by less than this, in pixels, looks through it.
_CENTERED = 1e-6

#: Meshes that have been converted, with the arrays that they are made of, as long as those of pyrender live.
_converted: WeakKeyDictionary[Any, tuple[list[Any], list[tuple[Mesh, Array]]]] = WeakKeyDictionary()


def translucent_nodes(scene: Any, names: Collection[str]) -> list[tuple[Any, str]]:
    """The visible mesh nodes of these names, or with meshes of these names, and which name it was; in a fixed order."""
    if not isinstance(scene, pyrender.Scene):
        raise InputError(f"pyrender scene {scene!r}", f"of type {type(scene).__name__}", "give a pyrender.Scene")
    nodes = sorted((node for node in scene.mesh_nodes if node.mesh.is_visible), key=_order)
    known = {name for node in nodes for name in (node.name, node.mesh.name) if name is not None}
    if unknown := sorted(set(names) - known):
        listed = ", ".join(map(repr, sorted(known))) or "no names: give nodes some, scene.add(mesh, name=...)"
        raise InputError(
            f"media for {', '.join(map(repr, unknown))}",
            f"no visible node or mesh of the pyrender scene has the name; it has {listed}",
            "use one of its names",
        )
    chosen = []
    for node in nodes:
        if (name := next((name for name in (node.name, node.mesh.name) if name in names), None)) is not None:
            chosen.append((node, name))
    return chosen


def _order(node: Any) -> tuple[str, str, list[float]]:
    return node.name or "", node.mesh.name or "", node.matrix.ravel().tolist()


def converted(scene: Any, media: Mapping[str, Medium], size: tuple[int, int], overlap: Overlap) -> Scene:
    """See `translucent.interop.pyrender.scene_from_pyrender`."""
    objects = []
    for node, name in translucent_nodes(scene, media):
        for mesh, pose in _meshes(node, node.mesh.name or name):
            objects.append(Object(mesh, media[name], scene.get_pose(node) @ pose))
    if not objects:
        raise InputError("rendering a pyrender scene", "no medium is given", "give media={'name': tl.Medium(...)}")
    background = Environment.constant(np.asarray(scene.bg_color[:3], dtype=np.float64) ** GAMMA)
    return Scene(objects, camera_of(scene, size), _lights(scene), background, overlap)


def _meshes(node: Any, name: str) -> list[tuple[Mesh, Array]]:
    """The mesh of a node, welded and wound, and where in the node it is; several if there are instances."""
    arrays = [array for p in node.mesh.primitives for array in (p.positions, p.indices, p.poses)]
    known = _converted.get(node.mesh)
    if known is None or len(known[0]) != len(arrays) or any(a is not b for a, b in zip(known[0], arrays, strict=True)):
        placed = [(mended(raw), pose) for raw, pose in _raw_meshes(node.mesh, name)]
        known = _converted[node.mesh] = arrays, placed
    return known[1]


def _raw_meshes(mesh: Any, name: str) -> Iterator[tuple[Mesh, Array]]:
    parts = [(p, *_triangles(p, name)) for p in mesh.primitives]
    instanced = [part for part in parts if part[0].poses is not None]
    for primitive, vertices, faces in instanced:
        raw = Mesh(vertices, faces, name=name)
        for pose in primitive.poses:
            yield raw, np.asarray(pose, dtype=np.float64)
    # What is not instanced may bound a body only together.
    if single := [part for part in parts if part[0].poses is None]:
        starts = np.cumsum([0] + [len(vertices) for _, vertices, _ in single], dtype=np.int32)
        faces = np.concatenate([faces + start for (_, _, faces), start in zip(single, starts, strict=False)])
        yield Mesh(np.concatenate([vertices for _, vertices, _ in single]), faces, name=name), np.eye(4)


def _triangles(primitive: Any, name: str) -> tuple[Array, npt.NDArray[np.int32]]:
    if primitive.mode != pyrender.GLTF.TRIANGLES:
        raise InputError(
            f"the medium of {name!r}", f"its mesh has a primitive of mode {primitive.mode}", "give it triangles"
        )
    vertices = np.asarray(primitive.positions, dtype=np.float64)
    corners = np.arange(len(vertices)) if primitive.indices is None else np.asarray(primitive.indices)
    return vertices, corners.reshape(-1, 3).astype(np.int32)


def camera_of(scene: Any, size: tuple[int, int]) -> Camera:
    """The camera that a pyrender scene is drawn with, if it is one of the toolkit's kinds."""
    node = scene.main_camera_node
    if node is None:
        raise InputError("rendering a pyrender scene", "it has no camera", "add one: scene.add(camera, pose=...)")
    camera, pose = node.camera, scene.get_pose(node)
    if isinstance(camera, pyrender.OrthographicCamera):
        # pyrender takes the width from the picture, whatever xmag says.
        return Camera(pose, fov_y=None, height=2.0 * camera.ymag)
    if isinstance(camera, pyrender.IntrinsicsCamera):
        off = (camera.cx - size[0] / 2, camera.cy - size[1] / 2)
        if max(map(abs, off)) > _CENTERED or not math.isclose(camera.fx, camera.fy, rel_tol=1e-9):
            raise InputError(
                "camera of the pyrender scene",
                f"its intrinsics fx {camera.fx:g}, fy {camera.fy:g}, cx {camera.cx:g}, cy {camera.cy:g} do not look "
                f"through the middle of {size[0]}x{size[1]} with square pixels",
                "draw in the size that they are for, with fx = fy, or use a PerspectiveCamera",
            )
        return Camera(pose, fov_y=math.degrees(2.0 * math.atan(size[1] / (2.0 * camera.fy))))
    if camera.aspectRatio is not None and not math.isclose(camera.aspectRatio, size[0] / size[1], rel_tol=1e-6):
        raise InputError(
            "camera of the pyrender scene",
            f"aspectRatio {camera.aspectRatio:g} for a picture of {size[0]}x{size[1]}, which it stretches",
            "leave aspectRatio out: it is that of the picture then",
        )
    return Camera(pose, fov_y=math.degrees(camera.yfov))


def _lights(scene: Any) -> list[Light]:
    found: list[Light] = []
    for node in sorted(scene.light_nodes, key=lambda node: (node.name or "", node.matrix.ravel().tolist())):
        light, pose = node.light, scene.get_pose(node)
        if np.linalg.matrix_rank(pose[:3, :3]) < 3:
            raise InputError(
                f"light {light.name or node.name or 'without a name'!r} of the pyrender scene",
                "the transform of its node is singular (a scale of 0, in it or above it)",
                "give every axis a scale other than 0",
            )
        power = light.intensity * np.asarray(light.color, dtype=np.float64)
        if isinstance(light, pyrender.PointLight):
            found.append(PointLight(pose[:3, 3], power))
        elif isinstance(light, pyrender.SpotLight):
            outer = min(math.degrees(light.outerConeAngle), 90.0)
            # Equal cones are an edge, there.
            inner = min(math.degrees(light.innerConeAngle), math.nextafter(outer, 0.0))
            found.append(SpotLight(pose[:3, 3], -pose[:3, 2], power, inner, outer))
        else:
            found.append(DirectionalLight(-pose[:3, 2], power))
    return found
