"""Ray caster of the CPU: Embree finds candidate faces in float32, and float64 decides the hits.

Lengths are in radii from the center of what a caster holds, where nothing else is said: float32 is finest there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import cache, cached_property
from importlib.metadata import version
from typing import TYPE_CHECKING, NamedTuple, Protocol
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Floats, Integers, Mask
from translucent.errors import RenderError
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import drawn_normals

if TYPE_CHECKING:
    from embreex.rtcore_scene import EmbreeScene


#: Step behind a face at which the search for the next one begins, in radii: nearer, float32 finds it again.
STEP = 2e-6

#: Distance before the center at which a search begins, in radii.
BEFORE = 1.01

#: Shortest distance from a surface to the next, in radii: anything nearer counts as behind.
NEAREST = 1e-13

#: Largest error, in radii, of a hit on the plane of a face: beyond it the ray runs along the plane.
PLANE_ERROR = 1e-4

#: Share of the radius of all objects by which bounds are enlarged before they are compared.
TOUCHING = 1e-4

#: Distance in radii from which Embree's answer is that a ray hits nothing.
MISSED = np.float32(1e30)

#: Number of rejected faces after which a ray ends.
MOST_REJECTED = 64

#: Oldest embreex that has all that is needed here.
_OLDEST = 4, 4

#: Smallest cosine between a normal for shading and a ray that hits its surface.
EDGE_ON = 1e-3


class RayCaster:
    """Ray caster for the triangles of one mesh, moved and scaled into the unit ball.

    Parameters
    ----------
    mesh : Mesh

    Attributes
    ----------
    center : (3,) float64
        Where the middle of the ball is, in the coordinates of the mesh.
    radius : float
        Of the ball, in metres.
    bounds : (2, 3) float64
        Smallest and largest coordinates of the mesh.
    scene : EmbreeScene
        Ready for rays.

    Raises
    ------
    RenderError
        If embreex cannot be imported.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.center = mesh.center
        self.radius = 0.5 * mesh.diagonal
        self.bounds = mesh.bounds
        with np.errstate(under="ignore"):
            vertices = ((mesh.vertices - self.center) / self.radius).astype(np.float32)
        self.scene = embree_scene((vertices, mesh.faces))

    def nearest(self, origins: Array, directions: Array) -> tuple[Integers, Array]:
        """Nearest face ahead, (k,), -1 where there is none, and its distance (k,), inf where there is none.

        Parameters
        ----------
        origins, directions : (k, 3) float64
            In the coordinates of the mesh. Distances count in lengths of the directions.
        """
        length = np.maximum(np.linalg.norm(directions, axis=1), np.finfo(np.float64).tiny)
        face, distance = self.first_hits((origins - self.center) / self.radius, directions / length[:, None])
        with np.errstate(over="ignore"):
            return face, np.where(face >= 0, distance * self.radius / length, np.inf)

    def distances(
        self,
        points: Array,
        directions: Array,
        point: npt.NDArray[np.integer],
        direction: npt.NDArray[np.integer],
    ) -> Floats:
        """Distance (n,) float32 at which rays hit the mesh, inf where they do not; as of `nearest`, and quicker.

        Parameters
        ----------
        points, directions : (k, 3), (m, 3) float64
            In the coordinates of the mesh. Distances count in lengths of the directions.
        point, direction : (n,) int
            Which of them each ray has.
        """
        length = np.maximum(np.linalg.norm(directions, axis=1), np.finfo(np.float64).tiny)
        with np.errstate(under="ignore", over="ignore"):
            origins = ((points - self.center) / self.radius).astype(np.float32)[point]
            found = self.scene.run(
                origins, (directions / length[:, None]).astype(np.float32)[direction], query="DISTANCE"
            )
            scale = (self.radius / length).astype(np.float32)[direction]
            return np.where(found < MISSED, found * scale, np.float32(np.inf))

    def candidates(
        self, origins: Array, directions: Array, expected: Integers, counted: Mask
    ) -> tuple[Integers, Integers]:
        """Faces on whole lines, ahead of the origins and behind.

        Embree finds only the nearest face ahead, so the search for the next one starts a little behind it. What is
        within this step is missed, and near edges a neighbor may be found instead of the face.

        Parameters
        ----------
        origins, directions : (k, 3) float64
            In the ball; directions have unit length.
        expected : (k,) int64
            After how many faces each search ends.
        counted : (m,) bool
            Faces that count.

        Returns
        -------
        ray, face : (n,) int64
        """
        rays, faces = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        start = -np.einsum("ki,ki->k", origins, directions) - BEFORE
        step, last = np.full(len(start), STEP), np.full(len(start), -1)
        missing = expected.copy()
        live = np.flatnonzero(missing > 0)
        # Twice as often as there are faces, since some are found again; no ray may go on for ever.
        for _ in range(2 * int(expected.max(initial=0)) + 8):
            face, distance = self.first_hits(origins[live] + start[live, None] * directions[live], directions[live])
            hit = face >= 0
            live, face, distance = live[hit], face[hit], distance[hit]
            again = face == last[live]
            rays.append(live[~again])
            faces.append(face[~again])
            last[live] = face
            missing[live] -= counted[face] & ~again
            step[live] = np.where(again, 2.0 * step[live], STEP)
            start[live] += distance + step[live]
            live = live[missing[live] > 0]
            if not live.size:
                break
        return np.concatenate(rays), np.concatenate(faces)

    def first_hits(self, origins: Array, directions: Array) -> tuple[Integers, Array]:
        """Nearest face ahead, (k,), -1 where there is none, and its distance (k,); rays as for `candidates`."""
        return first_hits(self.scene, origins, directions)


_CASTERS: WeakKeyDictionary[Mesh, RayCaster] = WeakKeyDictionary()


def ray_caster_of(mesh: Mesh) -> RayCaster:
    """Ray caster of a mesh, kept as long as the mesh is."""
    return _CASTERS.get(mesh) or _CASTERS.setdefault(mesh, RayCaster(mesh))


class PlacedMesh(Protocol):
    """Mesh with its transform to the world, such as an object of a scene."""

    @property
    def mesh(self) -> Mesh:
        """Triangles of the ray caster."""

    @property
    def matrix(self) -> Array:
        """(4, 4): to the world."""

    @property
    def bounds(self) -> Array:
        """(2, 3): smallest and largest world coordinates."""

    @property
    def faces_inwards(self) -> bool:
        """True if the faces, in the world, face into the body."""


class Faces(NamedTuple):
    """Faces of all objects, one object after the other; lengths in radii from the center of the scene.

    Attributes
    ----------
    corner, outward : (m, 3) float64
        First corner, and unit normal out of the body.
    edges : (m, 2, 3) float64
        From the first corner to the others.
    item : (m,) int64
        Index of the object.
    number : (m,) int64
        Of the face in its mesh.
    """

    corner: Array
    outward: Array
    edges: Array
    item: Integers
    number: Integers


class SceneRayCaster:
    """Ray caster for several objects: the nearest surface of each group of them that do not touch.

    Embree finds one of several faces in one place. Objects whose bounds touch are therefore in different Embree scenes,
    each with a hit of its own; objects that are apart share one.

    Parameters
    ----------
    objects : sequence of PlacedMesh
    """

    def __init__(self, objects: Sequence[PlacedMesh]) -> None:
        self.objects = objects
        boxes = np.stack([body.bounds for body in objects])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        self.center, self.radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
        self._groups = _groups(boxes, TOUCHING * self.radius)
        parts, self._scenes, self.first = [], [], []
        count = 0
        for group in self._groups:
            self.first.append(count)
            own = [self.corners(i) for i in group]
            parts += [(corners, np.full(len(corners), i)) for i, corners in zip(group, own, strict=True)]
            together = np.concatenate(own)
            count += len(together)
            faces = np.arange(3 * len(together), dtype=np.int32).reshape(-1, 3)
            self._scenes.append(embree_scene((together.reshape(-1, 3).astype(np.float32), faces)))
        corners, item = (np.concatenate(part) for part in zip(*parts, strict=True))
        edges = corners[:, 1:] - corners[:, :1]
        outward = np.cross(edges[:, 0], edges[:, 1])
        length = np.linalg.norm(outward, axis=1)
        sides = np.array([-1.0 if body.faces_inwards else 1.0 for body in objects])
        outward *= (sides[item] / np.where(length > 0, length, 1.0))[:, None]
        number = np.concatenate([np.arange(len(part[0])) for part in parts])
        self.faces = Faces(corners[:, 0].copy(), outward, edges, item, number)

    @property
    def groups(self) -> int:
        """Number of Embree scenes."""
        return len(self._scenes)

    def nearest(self, origins: Array, directions: Array, last: Integers) -> tuple[Integers, Array]:
        """Nearest faces ahead, one of each Embree scene.

        Parameters
        ----------
        origins, directions : (n, 3) float64
            In radii from the center; directions have unit length.
        last : (n, groups) int64
            Faces that the origins are on, which are not hit again; -1 for none.

        Returns
        -------
        face : (n, groups) int64
            -1 where there is none.
        distance : (n, groups) float64
            In radii; inf where there is none.
        """
        face, distance = np.full(last.shape, -1), np.full(last.shape, np.inf)
        # Origins may be far away, where float32 is coarse.
        begin = np.maximum(-dot(origins, directions) - BEFORE, STEP)
        for group, (scene, first) in enumerate(zip(self._scenes, self.first, strict=True)):
            live, start = np.arange(len(origins)), begin
            for _ in range(MOST_REJECTED):
                o, d = origins[live], directions[live]
                with np.errstate(under="ignore"):
                    own, rough = first_hits(scene, o + start[:, None] * d, d)
                found = np.flatnonzero(own >= 0)
                if not found.size:
                    break
                live, own, rough = live[found], own[found] + first, rough[found] + start[found]
                exact = self._on_planes(own, o[found], d[found], rough)
                counts = (own != last[live, group]) & (exact > NEAREST)
                face[live[counts], group], distance[live[counts], group] = own[counts], exact[counts]
                live, start = live[~counts], rough[~counts] + STEP
        return face, distance

    def _on_planes(self, face: Integers, origins: Array, directions: Array, rough: Array) -> Array:
        """(k,): distances to the planes of faces; `rough` (k,) are those of float32."""
        normal = self.faces.outward[face]
        with np.errstate(under="ignore", divide="ignore", invalid="ignore", over="ignore"):
            exact = dot(self.faces.corner[face] - origins, normal) / np.einsum("ki,ki->k", directions, normal)
        return np.where(np.abs(exact - rough) <= PLANE_ERROR, exact, rough)

    def barycentric(self, face: Integers, points: Array) -> Array:
        """(k, 3): weights of the corners of faces at points (k, 3) on them, in radii from the center."""
        one, other = self.faces.edges[face].transpose(1, 0, 2)
        across = points - self.faces.corner[face]
        a, b, c = (dot(x, y) for x, y in ((one, one), (one, other), (other, other)))
        p, q = dot(across, one), dot(across, other)
        area = a * c - b * b
        area = np.where(area > 0, area, 1.0)
        v, w = np.clip((c * p - b * q) / area, 0.0, 1.0), np.clip((a * q - b * p) / area, 0.0, 1.0)
        weights = np.stack([np.maximum(1.0 - v - w, 0.0), v, w], axis=1)
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))

    @cached_property
    def smooth(self) -> Array:
        """(m, 3, 3) float32: normals out of the body at the corners of the faces, for shading; not of unit length."""
        parts = []
        for i in (i for group in self._groups for i in group):
            body = self.objects[i]
            side = -1.0 if body.mesh.diagnosis.inverted else 1.0
            normals = side * drawn_normals(body.mesh) @ np.linalg.inv(body.matrix[:3, :3])
            length = np.linalg.norm(normals, axis=-1, keepdims=True).max(initial=1e-300)
            parts.append((normals / length).astype(np.float32))
        return np.concatenate(parts)

    def facing_normals(self, face: Integers, points: Array, directions: Array) -> tuple[Array, Array]:
        """Unit normals (k, 3) towards where rays come from: for shading, and of the faces.

        Parameters
        ----------
        face : (k,) int64
        points : (k, 3) float64
            On the faces, in radii from the center.
        directions : (k, 3) float64
            Of the rays.
        """
        smooth = np.einsum("kij,ki->kj", self.smooth[face], self.barycentric(face, points))
        flat = self.faces.outward[face].copy()
        away = dot(flat, directions) > 0
        flat[away] *= -1.0
        smooth[away] *= -1.0
        smooth = unit(smooth)
        facing = dot(smooth, directions)
        edge_on = np.flatnonzero(facing > -EDGE_ON)
        smooth[edge_on] -= (facing[edge_on] + EDGE_ON)[:, None] * directions[edge_on]
        smooth[edge_on] = unit(smooth[edge_on])
        return smooth, flat

    def places(self) -> list[tuple[int, int]]:
        """Group and first face of each object."""
        found = [(0, 0)] * len(self.objects)
        for number, (group, first) in enumerate(zip(self._groups, self.first, strict=True)):
            for i in group:
                found[i] = (number, first)
                first += len(self.objects[i].mesh.faces)
        return found

    def corners(self, i: int) -> Array:
        """(m, 3, 3): corners of the faces of an object, in radii from the center."""
        body = self.objects[i]
        middle = point_from(body.mesh.center, body.matrix, self.center)
        vertices = (body.mesh.vertices - body.mesh.center) @ body.matrix[:3, :3].T + middle
        with np.errstate(under="ignore"):
            return np.asarray((vertices / self.radius)[body.mesh.faces])


def _groups(boxes: Array, margin: float) -> list[list[int]]:
    """Numbers of bounding boxes (n, 2, 3), divided so that no two of a group touch."""
    groups: list[list[int]] = []
    boxes = boxes + np.array([[-margin], [margin]])
    for i in range(len(boxes)):
        for group in groups:
            others = boxes[group]
            apart = (others[:, 0] > boxes[i, 1]).any(axis=1) | (others[:, 1] < boxes[i, 0]).any(axis=1)
            if apart.all():
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def point_from(point: Array, matrix: Array, origin: Array) -> Array:
    """(3,): a point of a mesh in the world, in metres from `origin` (3,), rounded once."""
    terms = np.column_stack([matrix[:3, :3] * point, matrix[:3, 3], -origin])
    return np.array([math.fsum(row) for row in terms])


def dot(a: Array, b: Array) -> Array:
    """(k,): scalar products of vectors (k, 3)."""
    return np.asarray(np.einsum("ki,ki->k", a, b))


def unit(vectors: Array) -> Array:
    """Vectors (k, 3) with their length made 1, or left at 0."""
    length = np.sqrt(dot(vectors, vectors))
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0)[:, None])


def first_hits(scene: EmbreeScene, origins: Array, directions: Array) -> tuple[Integers, Array]:
    """Nearest triangle of an Embree scene ahead, (k,), -1 where there is none, and its distance (k,)."""
    with np.errstate(under="ignore", over="ignore"):
        rays = origins.astype(np.float32), directions.astype(np.float32)
    hits = scene.run(*rays, output=True)
    return hits["primID"].astype(np.int64), hits["tfar"].astype(np.float64)


def embree_versions() -> dict[str, str]:
    """Versions of embreex, and of the Embree in it; raises `RenderError` if it cannot be imported."""
    _import_embreex()
    return {"embreex": _embreex_version(), "embree": _embree_version()}


@cache  # the metadata of a package are files, and each plan asks
def _embreex_version() -> str:
    return version("embreex")


@cache  # making a device takes milliseconds, and each record of a batch asks
def _embree_version() -> str:
    from embreex.rtcore import EmbreeDevice

    return str(EmbreeDevice()).rpartition(" ")[2]


def embree_refusal() -> str:
    """Reason why Embree cannot be used; empty if it can."""
    try:
        import embreex.mesh_construction
        import embreex.rtcore_scene  # noqa: F401

        found = _embreex_version()
    except ImportError as error:  # or there are no metadata
        return f"embreex cannot be imported ({error})"
    return "" if _numbers(found) >= _OLDEST else f"embreex has version {found}, older than 4.4"


def _numbers(text: str) -> tuple[int, ...]:
    """The first two numbers of a version."""
    return tuple(map(int, re.findall(r"\d+", text)[:2]))


def _import_embreex() -> None:
    if refusal := embree_refusal():
        raise RenderError(
            "ray tracing on the CPU",
            refusal,
            "pip install -U embreex, or render with OpenGL (`translucent doctor` says how)",
        )


def embree_scene(*geometries: tuple[npt.NDArray[np.float32], npt.NDArray[np.int32]]) -> EmbreeScene:
    """Embree scene of triangles, each geometry by its vertices (n, 3) and faces (m, 3), ready for rays.

    Raises
    ------
    RenderError
        If embreex cannot be imported.
    """
    _import_embreex()
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene(robust=True)
    for vertices, faces in geometries:
        TriangleMesh(scene, vertices, faces)
    # The first ray builds the acceleration structure, which several threads must not do at once.
    scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
    return scene
