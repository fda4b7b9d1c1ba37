"""Surfaces of meshes, and rays into them: directions in a cone around the inward normal, and lengths.

Directions are scrambled Sobol points.

Embree finds the faces, float64 the distances. Each query finds the first face, from a start a little below the
surface. A ray that so finds the face through which it leaves the body has its exit, at the crossing of its line with
that face's plane, in float64. All others, few on most meshes, are followed face by face.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Floats, Integers
from translucent.bake.settings import BakeSettings
from translucent.errors import InputError
from translucent.formulas.sampling import MOST_POINTS, sobol_points
from translucent.geometry.mesh import Mesh
from translucent.geometry.normals import CREASE, smooth_normals
from translucent.geometry.ray_caster import RayCaster
from translucent.geometry.winding import one_volume

#: Smallest distance of a ray's start from the edges of its triangle, as a fraction of its height: a ray down an
#: adjacent wall would otherwise run in it.
INSET = 1e-3

#: Smallest area of a triangle, as a fraction of the squared diagonal, that float64 separates from rounding.
NO_AREA = 1e-24


@dataclass(frozen=True, eq=False)
class Points:
    """Origins of rays: points of a surface, in the unit ball around it.

    Attributes
    ----------
    face : (k,) int64
    exact : (k, 3) float64
        The point itself; points on a seam are equal from both sides.
    start : (k, 3) float64
        The point, kept off the edges of its face.
    normal : (k, 3) float64
        Smooth, of unit length, outwards.
    """

    face: Integers
    exact: Array
    start: Array
    normal: Array

    def __len__(self) -> int:
        return len(self.face)

    def __getitem__(self, index: slice | Integers) -> Points:
        return Points(self.face[index], self.exact[index], self.start[index], self.normal[index])


@dataclass(frozen=True, eq=False)
class PreparedMesh:
    """Mesh data that rays and points need. Lengths are in the unit ball around it.

    Attributes
    ----------
    embree : RayCaster
    faces : (m,) int64
        Indices of the mesh's faces that have an area; everywhere else a face is an index into this.
    corners : (m, 3, 3) float64
    planes : (m, 4) float64
        Unit normal and offset: n . p = w on the face.
    normals : (m, 3, 3) float64
        Smooth, at the corners.
    """

    embree: RayCaster
    faces: Integers
    corners: Array
    planes: Array
    normals: Array

    @classmethod
    def of(cls, mesh: Mesh) -> PreparedMesh:
        """Prepare a mesh.

        Parameters
        ----------
        mesh : Mesh

        Raises
        ------
        InputError
            If the mesh is not finite, has no area, or all its faces look inwards.
        RenderError
            If embreex cannot be imported.
        """
        mesh.require_finite()
        # All faces of a mesh without a negative volume cannot look inwards, and to examine it takes longer.
        if one_volume(mesh.vertices, mesh.faces) < 0 and mesh.diagnosis.inverted:
            raise InputError(
                f"mesh {mesh.name!r}",
                "all faces of the mesh point inwards",
                "flip the faces (tl.load_mesh does so automatically), or export the mesh again",
            )
        corners = ((mesh.vertices - mesh.center) / (0.5 * mesh.diagonal)).take(mesh.faces, axis=0)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        twice_area = np.sqrt(_dot(cross, cross))
        faces = np.flatnonzero(twice_area > NO_AREA)
        if not faces.size:
            raise InputError(f"mesh {mesh.name!r}", "no face of the mesh has an area", "give a triangle mesh")
        corners, normals = corners[faces], cross[faces] / twice_area[faces, None]
        offset = _dot(normals, (corners[:, 0] + corners[:, 1] + corners[:, 2]) / 3.0)
        with_area = Mesh(mesh.vertices, mesh.faces[faces], name=mesh.name)
        return cls(
            RayCaster(with_area),
            faces,
            corners,
            np.column_stack([normals, offset]),
            smooth_normals(mesh.vertices, mesh.faces[faces], normals),
        )

    @property
    def radius(self) -> float:
        """Metres per unit of length."""
        return self.embree.radius

    @cached_property
    def plane_columns(self) -> Array:
        """(4, m): `planes`, transposed: one number of each is taken at a time."""
        return np.ascontiguousarray(self.planes.T)

    def points(self, face: Integers, barycentric: Array) -> Points:
        """Points of faces (k,) with barycentric weights (k, 3)."""
        corners = np.take(self.corners, face, axis=0)
        exact = blend(corners, barycentric)
        start = exact.copy()
        least = np.minimum(np.minimum(barycentric[:, 0], barycentric[:, 1]), barycentric[:, 2])
        near = np.flatnonzero(least < INSET)
        start[near] = blend(corners[near], INSET + (1.0 - 3.0 * INSET) * barycentric[near])
        return Points(face, exact, start, self.smooth_normals(face, barycentric))

    def smooth_normals(self, face: Integers, barycentric: Array) -> Array:
        """(k, 3): unit normals; the face's own where the smooth one does not look to its outside."""
        smooth = blend(np.take(self.normals, face, axis=0), barycentric)
        own = np.take(self.planes, face, axis=0)[:, :3]
        # Much faster than reductions along an axis of three.
        length = np.sqrt(_dot(smooth, smooth))
        usable = _dot(smooth, own) > 1e-3 * length
        smooth /= np.where(usable, length, 1.0)[:, None]
        np.copyto(smooth, own, where=~usable[:, None])
        return smooth


def barycentric(corners: Array, point: Array) -> Array:
    """(k, 3): weights of points (k, 3) on the planes of triangles (k, 3, 3), moved into them where rounding led out."""
    a, b, c = corners.transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    areas = [np.cross(q - p, point - p) for p, q in ((b, c), (c, a), (a, b))]
    weights = np.stack([np.maximum((area * normal).sum(axis=1), 0.0) for area in areas], axis=1)
    total = weights.sum(axis=1, keepdims=True)
    return np.asarray(weights / np.where(total > 0, total, 1.0))


def _dot(a: Array, b: Array) -> Array:
    """(k,): dot products of the rows of (k, 3) and (k, 3)."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def blend(corners: Array, barycentric: Array) -> Array:
    """(k, 3): interpolation of (k, 3, 3) with barycentric weights (k, 3).

    Written out: sums of products over arrays may round according to where an element stands.
    """
    return np.asarray(
        corners[:, 0] * barycentric[:, :1] + corners[:, 1] * barycentric[:, 1:2] + corners[:, 2] * barycentric[:, 2:]
    )


#: Rays start this far below the surface, in radii of the mesh: beyond the rounding of float32, below the distance at
#: which `load_mesh` takes vertices for one.
OFFSET = 5e-7

#: The face on which a ray starts, and those beside it, may be found up to here; also the step behind a face.
NEAR = 2e-6

#: Smallest cosine at which a ray crosses a face and does not run along it, in float32 directions.
GRAZING = 1e-6

#: Distance behind the start within which a face is at it: rounding of float64, for all but the flattest angles.
BEHIND = 1e-10

#: Number of rays whose distances are computed at a time: their arrays stay in the cache of a processor.
CACHED_RAYS = 1 << 16

#: Number of rays that are followed face by face at a time: each has 120 bytes and more.
FOLLOWED_RAYS = 1 << 17


#: Number of independently scrambled sets, and largest number of values in all of them.
SETS, TABLE = 256, 1 << 22

#: Largest multiple of the requested rays from one point, where a tolerance needs more.
MOST_MULTIPLE, MOST_ADDED = 64, 8192

#: Binary digits of the points, as in float32.
DIGITS = 24

#: A sphere that touches the surface where a ray along w has its exit is seen from its center under pi - 2 theta: beyond
#: this theta the exit belongs to the smooth surface around the point, see `inscribed`.
SPHERE_CONE = 0.5 * (math.pi - CREASE)

#: Rays that a first sphere comes from: more take longer than the faces that they spare.
SPHERE_RAYS = 3

#: Distance, as a fraction of the radius, within which points have the same set: the same point of two charts, rounded
#: twice.
SAME_POINT = 2.0**-24


@dataclass(frozen=True, eq=False)
class InwardRays:
    """Rays into a surface, followed to their exits. Any number of threads may ask at once.

    Parameters
    ----------
    surface : PreparedMesh
    settings : BakeSettings
        Whether rays end at their first exit, and pass faces through which they enter once more.
    reach : float
        How far rays are followed, in radii; may be infinite.
    """

    surface: PreparedMesh
    settings: BakeSettings
    reach: float

    def distances(self, points: Points, directions: Floats) -> tuple[Array, int]:
        """(k, r): length inside the mesh from points (k) along directions (3, k, r), and how many rays Embree traced.

        In radii; infinite where a ray finds no exit. What lies beyond `reach` is some number at least as large.
        """
        rays = directions.shape[2]
        shaped, leaving, faces = self.first(points, directions)
        distance, leaves, face = shaped.reshape(-1), leaving.reshape(-1), faces.reshape(-1)
        settled = leaves if self.settings.gaps == "first-exit" else (distance >= self.reach) & (face >= 0)
        left = np.flatnonzero(~settled)
        traced = len(face)
        for begin in range(0, len(left), FOLLOWED_RAYS):
            ray = left[begin : begin + FOLLOWED_RAYS]
            walk = _RayWalk.of(points.start[ray // rays], directions.reshape(3, -1)[:, ray].T.astype(np.float64))
            walk.pass_exit(leaves[ray], distance[ray], face[ray])
            traced += self._follow(walk)
            distance[ray] = walk.length
        return np.maximum(distance, 0.0, out=distance).reshape(-1, rays), traced

    def first(self, points: Points, directions: Floats) -> tuple[Array, npt.NDArray[np.bool_], npt.NDArray[np.int32]]:
        """(k, r): distance to the plane of the first face, whether the ray leaves through it for certain, and the face.

        Any number, False and -1 where there is none.
        """
        count, rays = directions.shape[1:]
        origins = np.empty((3, count, rays), dtype=np.float32)
        origins[:] = self.starts(points).T[:, :, None]
        # The first face on each ray, -1 where there is none.
        traced = self.surface.embree.scene.run(origins.reshape(3, -1).T, directions.reshape(3, -1).T)
        face: npt.NDArray[np.int32] = traced.reshape(count, rays)
        distance, leaves = np.empty((count, rays)), np.empty((count, rays), dtype=bool)
        step = max(1, CACHED_RAYS // rays)
        with np.errstate(all="ignore"):
            for begin in range(0, count, step):
                some = slice(begin, begin + step)
                self._cross_planes(points.start[some], directions[:, some], face[some], distance[some], leaves[some])
        leaves &= face >= 0
        return distance, leaves, face

    def _cross_planes(
        self,
        start: Array,
        directions: Floats,
        face: npt.NDArray[np.int32],
        distance: Array,
        leaves: npt.NDArray[np.bool_],
    ) -> None:
        """Write distances (k, r) to the planes of faces (k, r), and whether rays leave there."""
        columns, chosen = self.surface.plane_columns, face.astype(np.intp)
        # Index -1 takes some face. Arrays stay contiguous and of one type, which NumPy multiplies twice as fast.
        np.take(columns[3], chosen, mode="clip", out=distance)
        normal, product = np.take(columns[0], chosen, mode="clip"), np.empty(face.shape)
        cosine = directions[0].astype(np.float64)
        cosine *= normal
        normal *= start[:, 0, None]
        distance -= normal
        for axis in (1, 2):
            np.take(columns[axis], chosen, mode="clip", out=normal)
            np.copyto(product, directions[axis])
            product *= normal
            cosine += product
            normal *= start[:, axis, None]
            distance -= normal
        distance /= cosine
        np.greater(cosine, GRAZING, out=leaves)

    def starts(self, points: Points) -> Floats:
        """(k, 3): where rays from points (k) begin, a little below the surface."""
        return (points.start - OFFSET * self.surface.planes[points.face, :3]).astype(np.float32)

    def _follow(self, walk: _RayWalk) -> int:
        """Follow rays to their ends, and count the rays that Embree traced."""
        traced = 0
        while walk.live.size:
            live = walk.live
            start = walk.origin[live] + walk.position[live, None] * walk.direction[live]
            hits = self.surface.embree.scene.run(
                start.astype(np.float32), walk.direction[live].astype(np.float32), output=True
            )
            traced += live.size
            self._step(walk, hits)
        return traced

    def _step(self, walk: _RayWalk, hits: dict[str, Any]) -> None:
        """Advance the live rays of a walk behind the face that each has found, or end them."""
        missed = hits["primID"] < 0
        walk.end(missed, np.where(walk.depth[walk.live] > 0, np.inf, walk.length[walk.live]))
        live = walk.live
        face, reached = hits["primID"][~missed].astype(np.int64), hits["tfar"][~missed].astype(np.float64)
        distance, cosine = self._cross(walk, face, walk.position[live] + reached)
        again = face == walk.last[live]
        walk.gap[live] = np.where(again, 2.0 * walk.gap[live], NEAR)
        walk.last[live] = face
        walk.position[live] = np.maximum(walk.position[live] + reached, distance) + walk.gap[live]
        leaves = (cosine > GRAZING) & (distance >= -BEHIND) & ~again
        # Going inwards, the face of the start and its neighbors are behind; farther off, another part begins.
        enters = (cosine < -GRAZING) & (distance > NEAR) & ~again
        self._cross_surface(walk, np.maximum(distance, 0.0), leaves, enters)

    def _cross(self, walk: _RayWalk, face: Integers, reached: Array) -> tuple[Array, Array]:
        """Distance to the planes of faces, and cosine at them; along a plane, the distance `reached` by Embree."""
        plane, origin, direction = self.surface.planes[face], walk.origin[walk.live], walk.direction[walk.live]
        cosine = plane[:, 0] * direction[:, 0] + plane[:, 1] * direction[:, 1] + plane[:, 2] * direction[:, 2]
        height = plane[:, 3] - plane[:, 0] * origin[:, 0] - plane[:, 1] * origin[:, 1] - plane[:, 2] * origin[:, 2]
        across = np.abs(cosine) > GRAZING
        return np.where(across, height / np.where(across, cosine, 1.0), reached), cosine

    def _cross_surface(
        self, walk: _RayWalk, distance: Array, leaves: npt.NDArray[np.bool_], enters: npt.NDArray[np.bool_]
    ) -> None:
        """Count the crossings of the live rays, and end the ones that leave."""
        live = walk.live
        if self.settings.gaps == "first-exit":
            walk.end(leaves | (enters & (not self.settings.ignore_back_faces)), distance)
            return
        was, entered = walk.depth[live], walk.entered[live]
        cut = walk.length[live] + np.where(was > 0, self.reach - entered, 0.0)
        walk.depth[live] = np.maximum(was + enters.astype(np.int64) - leaves, 0)
        walk.length[live] += np.where((was == 1) & leaves, distance - entered, 0.0)
        walk.entered[live] = np.where((was == 0) & enters, distance, entered)
        walk.end(distance >= self.reach, cut)


@dataclass(eq=False)
class _RayWalk:
    """Walk of rays, one per row; `live` has the indices of unfinished rays."""

    origin: Array
    direction: Array
    live: Integers
    position: Array
    gap: Array
    last: Integers
    depth: Integers
    entered: Array
    length: Array

    @classmethod
    def of(cls, origin: Array, direction: Array) -> _RayWalk:
        """Rays (n, 3) that begin inside a body, a step before their start."""
        count = len(origin)
        return cls(
            origin,
            direction,
            np.arange(count),
            np.full(count, -NEAR),
            np.full(count, NEAR),
            np.full(count, -1),
            np.ones(count, dtype=np.int64),
            np.zeros(count),
            np.zeros(count),
        )

    def pass_exit(self, rays: npt.NDArray[np.bool_], distance: Array, face: npt.NDArray[np.int32]) -> None:
        """Let some of the rays begin behind the exit that has been found for them at `distance`."""
        self.position[rays] = distance[rays] + NEAR
        self.last[rays] = face[rays]
        self.depth[rays] = 0
        self.length[rays] = np.maximum(distance[rays], 0.0)

    def end(self, done: npt.NDArray[np.bool_], length: Array) -> None:
        """End some of the live rays, with their lengths (live,)."""
        self.length[self.live[done]] = length[done]
        self.live = self.live[~done]


@dataclass(frozen=True, eq=False)
class Directions:
    """Ray directions of a bake, independent of the order of points and the number of threads.

    Attributes
    ----------
    table : (3, sets, rays) float32
        Along tangent, bitangent and inward normal; as many rays as a point may ever need.
    seed : int
    """

    table: Floats
    seed: int

    @classmethod
    def of(cls, settings: BakeSettings) -> Directions:
        """Directions for these settings: one down the normal, or Sobol points in the cone."""
        if settings.mode == "inscribed":
            points = _sobol(min(settings.rays, SPHERE_RAYS), SETS, settings.seed)
            return cls(_in_cone(points, SPHERE_CONE, "uniform"), settings.seed)
        if settings.mode == "normal":
            return cls(np.array([0.0, 0.0, 1.0], np.float32).reshape(3, 1, 1), settings.seed)
        count = settings.rays
        if settings.tolerance is not None:
            count = max(count, min(MOST_MULTIPLE * count, MOST_ADDED))
        sets = max(1, min(SETS, TABLE // count))
        points = _sobol(count, sets, settings.seed)
        return cls(_in_cone(points, math.radians(settings.spread / 2.0), settings.weighting), settings.seed)

    @property
    def most(self) -> int:
        """Largest number of rays of a point."""
        return int(self.table.shape[2])

    def at(self, points: Points, begin: int, end: int) -> Floats:
        """(3, k, end - begin): world directions of rays `begin` to `end` of each point."""
        sets = self.table.shape[1]
        chosen = _hash(points.exact, self.seed, sets) if sets > 1 else np.zeros(len(points), dtype=np.int64)
        inward = -points.normal
        frame = [axis.astype(np.float32) for axis in (*_tangents(inward), inward)]
        table, rays = self.table[:, :, begin:end], end - begin
        world = np.empty((3, len(points), rays), dtype=np.float32)
        step = max(1, CACHED_RAYS // rays)
        for first in range(0, len(points), step):
            some = slice(first, first + step)
            local = np.take(table, chosen[some], axis=1)
            product = np.empty(local.shape[1:], dtype=np.float32)
            for axis in range(3):
                into = world[axis, some]
                np.multiply(local[0], frame[0][some, axis, None], out=into)
                for component in (1, 2):
                    np.multiply(local[component], frame[component][some, axis, None], out=product)
                    into += product
        return world


@lru_cache(maxsize=1)  # a batch needs the same ones again and again
def _sobol(count: int, sets: int, seed: int) -> Array:
    """(sets, count, 2): the first points of the Sobol sequence in 0..1, scrambled independently (Owen 1995).

    SciPy scrambles by a linear map and a shift, which leave blocks of the sequence so alike that they may have equal
    means; nested scrambling, in which each digit is turned or not by a coin of all digits before it, does not.
    """
    digits = np.round(_plain_sobol(count) * 2**DIGITS).astype(np.uint64)
    keys = _mix(np.arange(2 * sets, dtype=np.uint64) + _mix(np.full(2 * sets, seed, dtype=np.uint64)))
    coins = keys.reshape(sets, 1, 2)
    scrambled = np.zeros((sets, count, 2), dtype=np.uint64)
    for digit in range(DIGITS):
        # The leading 1 distinguishes prefixes of different lengths.
        prefix = (digits + np.uint64(2**DIGITS)) >> np.uint64(DIGITS - digit)
        own = (digits >> np.uint64(DIGITS - 1 - digit)) & np.uint64(1)
        turned = _mix(coins ^ prefix) >> np.uint64(63)
        scrambled = (scrambled << np.uint64(1)) | (own ^ turned)
    found = np.asarray((scrambled + 0.5) / 2.0**DIGITS)
    found.setflags(write=False)
    return found


def _plain_sobol(count: int) -> Array:
    """(count, 2): the first points in 0..1 of the Sobol sequence: stored ones, as SciPy's statistics load slowly."""
    if count <= MOST_POINTS:
        return sobol_points(count)
    from scipy.stats import qmc

    with warnings.catch_warnings():
        # SciPy warns that numbers other than powers of 2 lose the balance of the sequence; they are still well spread.
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(qmc.Sobol(2, scramble=False).random(count))


def _in_cone(points: Array, half_angle: float, weighting: str) -> Floats:
    """(3, sets, rays): points (sets, rays, 2) of the square as directions within `half_angle` of the z axis."""
    height, turn = points[..., 0], 2.0 * np.pi * points[..., 1]
    if weighting == "cosine":
        # The projected solid angle is uniform in sin^2.
        sine = np.sqrt(height) * math.sin(half_angle)
        cosine = np.sqrt(1.0 - sine * sine)
    else:
        # The solid angle is uniform in 1 - cos.
        fall = height * 2.0 * math.sin(half_angle / 2.0) ** 2
        cosine, sine = 1.0 - fall, np.sqrt(fall * (2.0 - fall))
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine]).astype(np.float32)


def _tangents(normal: Array) -> tuple[Array, Array]:
    """(k, 3), (k, 3): two axes that complete unit normals (k, 3) to a frame (Duff et al. 2017, listing 3)."""
    x, y, z = normal.T
    sign = np.where(z < 0, -1.0, 1.0)
    with np.errstate(under="ignore"):
        a = -1.0 / (sign + z)
        b = x * y * a
        tangent = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
        return tangent, np.stack([b, sign + y * y * a, -y], axis=1)


def _hash(points: Array, seed: int, sets: int) -> npt.NDArray[np.int64]:
    """(k,): index of the set of random numbers of each point, computed from its position."""
    cells = np.round(points / SAME_POINT).astype(np.int64).view(np.uint64)
    mixed = np.full(len(points), seed, dtype=np.uint64)
    for axis in range(3):
        mixed = _mix(mixed + cells[:, axis])
    return (mixed % np.uint64(sets)).astype(np.int64)


def _mix(keys: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """A random number for each key: the step of SplitMix64 (Steele, Lea and Flood 2014)."""
    mixed = keys + np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))
