"""Meshes and bodies that only measurements need, made here."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.assets import mesh_path
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import Box, Ellipsoid, Sphere, Torus
from translucent.media.medium import Medium
from translucent.mesh_files import load_mesh
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment
from translucent.scene.scene import Object, Scene
from translucent.threads import import_trimesh

Vertices = npt.NDArray[np.float64]
Faces = npt.NDArray[np.int32]


def placed(mesh: Mesh, medium: Medium | None, place: Sequence[float], **more: Any) -> Object:
    """An object whose origin is at a place."""
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return Object(mesh, medium, matrix, **more)


def across(mesh: Mesh, *depths: float) -> npt.NDArray[np.float64]:
    """Coefficients of a medium, in 1/m, with these optical depths across the diagonal of a mesh."""
    return np.array(depths) / mesh.diagonal


def square_ground(color: Sequence[float], height: float = 0.0) -> Object:
    """A flat opaque square of 8 m by 8 m."""
    corners = np.array([(-4, height, -4), (-4, height, 4), (4, height, 4), (4, height, -4)], dtype=np.float64)
    return Object(Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)], np.int32), name="ground"), color=tuple(color))


def bent_leaf(sky: Environment) -> Scene:
    """A bent leaf before a sky, three mean free paths thick in the middle."""
    ball = Sphere().tessellate(64)
    x, y, z = ball.vertices.T
    vertices = np.stack([0.6 * x, 0.015 * y + 0.18 * np.sin(1.2 * x) + 0.12 * z, z], axis=1)
    medium = Medium((8.0, 2.0, 16.0), (100.0, 110.0, 80.0), anisotropy=0.4)
    camera = Camera.look_at((0.6, 1.9, 2.6), (0.0, 0.0, 0.0), fov_y=36.0)
    return Scene([Object(Mesh(vertices, ball.faces, name="leaf"), medium)], camera, (), sky)


def toolkit(name: str) -> Mesh:
    """A mesh of the toolkit."""
    return load_mesh(mesh_path(name))


def subdivided(name: str, triangles: int) -> Mesh:
    """A mesh of the toolkit with each face cut in four until it has at least this many."""
    remesh = import_trimesh("trimesh.remesh")

    mesh = toolkit(name)
    vertices, faces = mesh.vertices, mesh.faces
    while len(faces) < triangles:
        vertices, faces = remesh.subdivide(vertices, faces)
    return Mesh(vertices, faces, name=name)


def lying_torus(segments: int, major: float = 1.0, minor: float = 0.35) -> Mesh:
    """A ring around the y axis: seen from the front, rays go through it twice."""
    mesh = Torus(major, minor).tessellate(segments)
    return Mesh(mesh.vertices[:, [1, 2, 0]], mesh.faces, name="torus")


def menger_sponge(level: int = 3) -> Mesh:
    """The surface of a cube with holes in its holes (Menger 1926), on a grid of 3^level cells along each side."""
    count = 3**level
    digits = np.array(list(itertools.product(range(count), repeat=3)))
    solid = np.ones(len(digits), dtype=bool)
    for power in range(level):
        # A cell is gone where two of its three coordinates are in the middle third, at any scale.
        solid &= ((digits // 3**power % 3) == 1).sum(axis=1) < 2
    cells = surface_of_cells(solid.reshape(count, count, count))
    return Mesh(cells.vertices / count - 0.5, cells.faces, name="menger sponge")


def surface_of_cells(solid: npt.NDArray[np.bool_]) -> Mesh:
    """The surface of solid cells (x, y, z), of unit size, with two triangles for each of their squares."""
    cells = np.pad(solid, 1)
    quads = []
    for axis, side in itertools.product(range(3), (0, 1)):
        here = cells & ~np.roll(cells, -1 if side else 1, axis)
        corner = np.argwhere(here) - 1
        corner[:, axis] += side
        u, v = np.eye(3, dtype=np.int64)[(axis + 1) % 3], np.eye(3, dtype=np.int64)[(axis + 2) % 3]
        if not side:
            u, v = v, u
        quads.append(np.stack([corner, corner + u, corner + u + v, corner + v], axis=1))
    points, indices = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    square = indices.reshape(-1, 4)
    faces = np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])
    return Mesh(points, faces, name="cells")


def nested_shells(shells: int = 6, segments: int = 96) -> Mesh:
    """Hollow balls within each other: every second sphere is wound inwards."""
    radii = np.linspace(1.0, 0.15, 2 * shells)
    parts = [Sphere(radius=float(radius)).tessellate(segments) for radius in radii]
    return joined([(p.vertices, p.faces if i % 2 == 0 else p.faces[:, ::-1]) for i, p in enumerate(parts)], "shells")


def lens_row(lenses: int = 3, segments: int = 64) -> Mesh:
    """Lenses, one behind the other along z: flat ellipsoids, apart by half of their width."""
    lens = Ellipsoid(radii=(1.0, 1.0, 0.3)).tessellate(segments)
    return joined([(lens.vertices - (0, 0, i), lens.faces) for i in range(lenses)], "lenses")


def plates(layers: int) -> Mesh:
    """Square plates behind each other along z from 0 to -1, with an even number of surfaces."""
    count = layers // 2
    pitch = 1.0 / count
    plate = Box((-0.5, -0.5, -0.5 * pitch), (0.5, 0.5, 0.0)).tessellate()
    return joined([(plate.vertices - (0, 0, i * pitch), plate.faces) for i in range(count)], "plates")


def bow_tie() -> Mesh:
    """Box twisted into a bow tie: closed and consistently wound, with the lobe in front inside out."""
    box = Box((-1.0, -0.5, -1.0), (1.0, 0.5, 1.0)).tessellate()
    return Mesh(box.vertices * np.where([1, 0, 0], -box.vertices[:, 2:], 1.0), box.faces, name="bow tie")


def backward_window() -> Mesh:
    """A plate, 1 by 1, with a window of its own tessellation on both sides, wound the wrong way.

    Its vertices are not those of the frame around it, so that all edges between the two are open.
    """
    top, steps = 0.003, np.linspace(-0.2, 0.2, 9)
    frame = [(-0.5, -0.5, 0.5, -0.2), (-0.5, 0.2, 0.5, 0.5), (-0.5, -0.2, -0.2, 0.2), (0.2, -0.2, 0.5, 0.2)]
    window = [(x, y, u, v) for x, u in itertools.pairwise(steps) for y, v in itertools.pairwise(steps)]
    rim = Box((-0.5, -0.5, -top), (0.5, 0.5, top)).tessellate()
    parts = [(rim.vertices, rim.faces[rim.face_normals[:, 2] == 0])]
    for rectangles, turned in ((frame, False), (window, True)):
        for x, y, u, v in rectangles:
            for z, upwards in ((top, not turned), (-top, turned)):
                corners = np.array([(x, y, z), (u, y, z), (u, v, z), (x, v, z)])
                faces = np.array([(0, 1, 2), (0, 2, 3)], dtype=np.int32)
                parts.append((corners, faces if upwards else faces[:, ::-1]))
    return joined(parts, "plate with a window")


def inside_out_slab_beside_an_open_box() -> Mesh:
    """A box of 1 x 1 x 0.02, inside out, in one mesh with a box that lacks a triangle."""
    slab, box = Box.slab((1.0, 1.0), 0.02).tessellate(), Box((1.5, -0.5, -0.5), (2.5, 0.5, 0.5)).tessellate()
    return joined([(slab.vertices, slab.faces[:, ::-1]), (box.vertices, box.faces[1:])], "slab and open box")


def joined(parts: list[tuple[Vertices, Faces]], name: str) -> Mesh:
    """One mesh of several, each as vertices and faces."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    faces = np.concatenate([faces + offset for (_, faces), offset in zip(parts, offsets, strict=True)])
    return Mesh(np.concatenate([vertices for vertices, _ in parts]), faces, name=name)
