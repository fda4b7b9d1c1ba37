"""Grid of a body in which light diffuses: cells that its surface cuts, and sample points on the surface.

Cells and samples are in the coordinates that the body's transform leads to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from translucent.arrays import Array, Floats, Integers, Mask, expanded
from translucent.diffusion.interfaces import EscapePaths
from translucent.diffusion.voxels import Voxels, cut_cells, voxels, without
from translucent.formulas import optics
from translucent.geometry.mesh import Mesh, Triangles, joined
from translucent.geometry.normals import drawn_normals
from translucent.geometry.ray_caster import RayCaster, ray_caster_of
from translucent.scene.scene import Object

#: Sample points on the surface for each area of a cell's face.
SAMPLES = 3.0

#: Least area around a sample, as a fraction of the mean.
LEAST_AREA = 0.1

#: Cosine between the normals of both sides, up to which a wall is one, and from which on it is none.
PARALLEL, ASLANT = -0.95, -0.8

#: Half the thickness of walls, in cells, up to which the fluence is read halfway through.
MIDDLE = 1.25

#: Thickness of walls, in cells, below which both sides read cells of each other.
THIN = 4.0

#: Finer samples for each of these, which measure the area around it.
FINE = 4.0

#: Fraction of a cell that must be inside for the cell to count: thinner slivers would only make the system stiff.
LEAST_INSIDE = 0.05

#: Depths below the surface, in cells, at which the fluence is read: the first that enough of the body surrounds.
PROBE_DEPTHS = (1.0, 0.75, 0.5, 0.25)

#: Fraction of the eight cells around such a point that must be inside.
LEAST_AROUND = 0.55

#: Shortest distance between the centers of two cells, and least depth, in cells.
LEAST_LENGTH, LEAST_DEPTH = 0.3, 0.1

#: Paths below each sample that measure the unscattered light, and their start below it, in cells.
INWARD_DIRECTIONS, START = 8, 1e-4

#: Blocks of cells along the longest side of a grid. The solver corrects the mean error of each.
BLOCKS = 8

#: Least cosine between the normals of neighboring samples on one smooth surface; and what is added to the squared
#: distances of neighbors in fits of slopes, as a fraction of a sample's area, so that few neighbors give small slopes.
SMOOTH, STIFF = 0.5, 1e-2

#: Largest change of a surface's area over the depth of reading, as half of its logarithm: mean curvature times depth.
MOST_CURVED = 0.25

#: Number of times that means over neighbors are squared where random rays are few.
MEANS = 3

#: Most steps in which values are smoothed along the surface.
SMOOTHINGS = 8

#: Places in each layer between the surface and the depth of reading at which its volume is counted.
LAYER_PLACES = (np.arange(4) + 0.5) / 4

#: Samples next to each other for which something is found together.
TOGETHER = 6


@dataclass(frozen=True, eq=False)
class Probe:
    """Linear interpolation of cell values at points, from the eight cells around each as far as they are inside.

    Attributes
    ----------
    cells, weights : (points, 8) int64, float64
        Numbers of the cells, and weights, which sum to 1 at each point, or to 0 where no cell is near.
    places : (points, 8) int64
        Of the cells in the flat grid.
    around : (points,) float64
        Fraction of the cells around each point that is inside.
    """

    cells: Integers
    weights: Array
    places: Integers
    around: Array


@dataclass(frozen=True, eq=False)
class Inclusions:
    """Sample points on the surfaces of opaque objects inside a body.

    Attributes
    ----------
    points, normals : (i, 3) float64
        Normals are towards the body.
    owner : (i,) int64
        Number of the object that each is on.
    read : (i, cells) csr_array
        Interpolation of the fluence somewhat beside each.
    depth, spread : (i,) float64
        Distance in m at which it is read, and by which its flux comes from nearer, see `BodyGrid.spread`.
    area : float
        Of the surface around each, in m^2.
    caster : RayCaster
        Of all of these objects.
    """

    points: Array
    normals: Array
    owner: Integers
    read: sparse.csr_array
    depth: Array
    spread: Array
    area: float
    caster: RayCaster

    @cached_property
    def tree(self) -> cKDTree:
        """For looking up the sample nearest to a place."""
        return cKDTree(self.points)

    def met(self, points: Array, directions: Array) -> tuple[Array, Integers]:
        """Distance (k,) at which rays (k, 3), (k, 3) inside the body hit one, inf for none, and the sample there."""
        number = np.arange(len(points))
        distance = self.caster.distances(points, directions, number, number).astype(np.float64)
        sample, hit = np.zeros(len(points), np.int64), np.isfinite(distance)
        sample[hit] = self.tree.query(points[hit] + distance[hit, None] * directions[hit])[1]
        return distance, sample


@dataclass(frozen=True, eq=False)
class BodyGrid:
    """Cells of a body and sample points on its surface, in the coordinates that its transform leads to.

    Attributes
    ----------
    cells : Voxels
    number : (x, y, z) int
        Of each cell in the system, -1 where it does not count.
    points, face_normals, normals : (s, 3) float64
        Sample points on the surface, spread evenly.
    area : float
        Mean of those.
    areas : (s,) float64
        Of the surface around each sample, in m^2: samples are only nearly even, and a cell that loses light through too
        many is too dark.
    body : Object
    opaque : tuple of Object
        Closed opaque objects that may be inside it, in the same coordinates.
    """

    cells: Voxels
    number: Integers
    points: Array
    face_normals: Array
    normals: Array
    area: float
    areas: Array
    body: Object
    opaque: tuple[Object, ...] = ()
    _body_cells: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    _crossings: dict[float, tuple[Array, Array]] = field(default_factory=dict)
    _escape_paths: dict[float, EscapePaths] = field(default_factory=dict)

    @cached_property
    def nearest(self) -> Integers:
        """(s, `TOGETHER`): each sample and its nearest neighbors."""
        count = len(self.points)
        return np.reshape(self.tree.query(self.points, min(TOGETHER, count))[1], (count, -1))

    @cached_property
    def tree(self) -> cKDTree:
        """Tree of the samples, to look up the nearest ones to a place."""
        return cKDTree(self.points)

    def crossings(self, ior: float) -> tuple[Array, Array]:
        """(w, s, 3), (w, s): `inward_directions` of each sample, and metres to where they leave the body."""
        if ior not in self._crossings:
            start = self.points - START * self.cells.step * self.face_normals
            into, caster = np.linalg.inv(self.body.matrix), ray_caster_of(self.body.mesh)
            directions = np.stack([self.inward_directions(ior, number) for number in range(INWARD_DIRECTIONS)])
            local = directions.reshape(-1, 3) @ into[:3, :3].T
            point = np.tile(np.arange(len(start)), INWARD_DIRECTIONS)
            found = caster.distances(start @ into[:3, :3].T + into[:3, 3], local, point, np.arange(len(local)))
            if self.inclusions is not None:
                found = np.minimum(found, self.inclusions.met(start[point], directions.reshape(-1, 3))[0])
            metres = np.where(np.isfinite(found), found, 0.0).astype(np.float64).reshape(directions.shape[:2])
            self._crossings.clear()
            self._crossings[ior] = directions, metres
        return self._crossings[ior]

    def escape_paths(self, ior: float) -> EscapePaths:
        """Paths out of the body through a surface of this index; the last ones are cached."""
        if ior not in self._escape_paths:
            start = self.points - START * self.cells.step * self.face_normals
            self._escape_paths.clear()
            self._escape_paths[ior] = EscapePaths.of(self.body, start, self.inward_directions(1.0), ior)
        return self._escape_paths[ior]

    def inward_directions(self, ior: float, number: int = 0) -> Array:
        """(s, 3): set `number` of directions inside, one for each sample, distributed as refracted uniform light."""
        # Not the numbers by which the samples lie on large triangles: there, light would come from one side alone.
        first, second = other_plane_points(len(self.points)).T
        first, second = (first + number / INWARD_DIRECTIONS) % 1.0, (second + 0.618 * number) % 1.0
        # In a medium of a smaller index the light that is not reflected totally fills the whole hemisphere.
        cosine = optics.refracted_cosine(np.sqrt(first), max(ior, 1.0))
        across, along = self._tangents
        angle, level = 2.0 * np.pi * second, np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
        sideways = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * along
        return np.asarray(level[:, None] * sideways - cosine[:, None] * self.face_normals)

    @cached_property
    def _tangents(self) -> tuple[Array, Array]:
        """(s, 3), (s, 3): two directions along the surface at each sample, at right angles."""
        normal = self.face_normals
        aside = np.where(np.abs(normal[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        across = np.cross(normal, aside)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        return across, np.cross(normal, across)

    @cached_property
    def count(self) -> int:
        """Number of cells in the system."""
        return int(self.number.max(initial=-1)) + 1

    @cached_property
    def volumes(self) -> Array:
        """(cells,): volume inside each cell in m^3."""
        return np.asarray(self.cells.inside[self.number >= 0] * self.cells.step**3)

    @cached_property
    def faces(self) -> tuple[Integers, Integers, Array]:
        """(f,), (f,), (f,): the two cells at each face between them, and its open area over their distance, in m."""
        first, second, ratio = [], [], []
        for axis in range(3):
            lower: list[slice] = [slice(None)] * 3
            upper, middle = list(lower), list(lower)
            lower[axis], upper[axis], middle[axis] = slice(0, -1), slice(1, None), slice(1, -1)
            a, b = self.number[tuple(lower)], self.number[tuple(upper)]
            area = self.cells.open_area[axis][tuple(middle)]
            apart = self.cells.center[tuple(upper)][..., axis] - self.cells.center[tuple(lower)][..., axis]
            joined = (a >= 0) & (b >= 0) & (area > 0.0)
            first.append(a[joined])
            second.append(b[joined])
            ratio.append(area[joined] / np.maximum(apart[joined], LEAST_LENGTH) * self.cells.step)
        return np.concatenate(first), np.concatenate(second), np.concatenate(ratio)

    @cached_property
    def below(self) -> tuple[sparse.csr_array, Array]:
        """Interpolation of the fluence somewhat below each sample, and its depth there in m, (s,)."""
        return self._reading[:2]

    @cached_property
    def spreading(self) -> sparse.csc_array:
        """(cells, s): transposed interpolation of `below`: a power at each sample, for the cells that are read."""
        return sparse.csc_array(self.below[0].T)

    @cached_property
    def spread(self) -> Array:
        """(s,): metres by which the flux to each sample comes from less deep than where the fluence is read.

        The cells that a sample reads lie at several depths, and each gives a part of the flux: above the deepest one
        not all of it flows, and the fluence falls less towards the surface than it should. With weights that sum to
        A(z) down to a depth z it is too high by the flux over D times the integral of A (1 - A). In a wall of few cells
        with parallel sides the cells that the other side reads, with weights that sum to B(z), give some of it where it
        is taken, and the difference between both sides is that over (A - B)^2: of 2 B (1 - A) less each side has half.
        """
        weights, heights = self._reading[2:]

        def later(one: Integers, first: Array, other: Integers, second: Array) -> Array:
            """Mean over the cells of both by how much the second is deeper, where it is."""
            deeper = np.maximum(second[:, None, :] - first[:, :, None], 0.0)
            return np.asarray(np.einsum("si,sj,sij->s", weights[one], weights[other], deeper))

        samples = np.arange(len(weights))
        found = np.mean([later(samples, heights, other, heights[other]) for other in self.nearest.T], axis=0)
        thin, across = self.across
        normal = self.face_normals
        aside = (self.points[thin] - self.points[across]) / self.cells.step
        below = (aside * normal[thin]).sum(axis=1)[:, None] - heights[across]
        found[thin] -= self.parallel * later(across, below, thin, heights[thin])
        return np.asarray(found * self.cells.step)

    @cached_property
    def _alike(self) -> tuple[Array, Array]:
        """(s, n), (s, n, 3): 1 for samples of `nearest` on the same smooth surface, else 0, and metres to them."""
        alike = (self.normals[self.nearest] * self.normals[:, None]).sum(axis=2) > SMOOTH
        return alike.astype(np.float64), alike[..., None] * (self.points[self.nearest] - self.points[:, None])

    @cached_property
    def _divergence(self) -> sparse.csr_array:
        """(s, 3 s): divergence of a vector field from its values at the samples, by differences to `nearest`."""
        normal, (_, offset) = self.normals, self._alike
        along = normal[:, :, None] * normal[:, None, :]
        spread = np.einsum("sni,snj->sij", offset, offset) + self.area * (along + STIFF * np.eye(3))
        factors = offset @ np.linalg.inv(spread) @ (np.eye(3) - along)
        own = np.arange(len(normal))[:, None]
        factors = np.concatenate([factors, -factors.sum(axis=1, keepdims=True)], axis=1)
        of = 3 * np.concatenate([self.nearest, own], axis=1)[:, :, None] + np.arange(3)
        starts = np.arange(len(own) + 1) * of[0].size
        return sparse.csr_array((factors.ravel(), of.ravel(), starts), (len(own), 3 * len(own)))

    def divergence(self, vectors: Array) -> Array:
        """(s,): divergence along the surface of vectors (s, 3) at the samples, by least squares over neighbors."""
        return np.asarray(self._divergence @ vectors.ravel())

    @cached_property
    def curvature(self) -> Array:
        """(s,): mean curvature of the surface in 1/m, limited by `MOST_CURVED`; positive where it is convex."""
        found, most = 0.5 * self.divergence(self.normals), MOST_CURVED / self.below[1]
        return np.asarray(np.clip(found[self.nearest].mean(axis=1), -most, most))

    @cached_property
    def _mean_of_neighbors(self) -> tuple[sparse.csr_array, float]:
        """Mean (s, s) over `nearest` samples, and its variance along one axis of the surface in m^2."""
        near, (alike, offset) = self.nearest, self._alike
        weight = alike * self.areas[near]
        weight /= weight.sum(axis=1, keepdims=True)
        variance = 0.5 * float((weight * (offset**2).sum(axis=2)).sum(axis=1).mean())
        starts = np.arange(len(near) + 1) * near.shape[1]
        return sparse.csr_array((weight.ravel(), near.ravel(), starts), (len(near), len(near))), variance

    @cached_property
    def mean_around(self) -> sparse.csr_array:
        """(s, s): mean over some tens of samples around each, on the same smooth surface, where rays are few."""
        mean = self._mean_of_neighbors[0]
        for _ in range(MEANS):
            mean = sparse.csr_array(mean @ mean)
        return mean

    def smoothed(self, values: Array, variance: float) -> Array:
        """(s,): values (s,) at the samples, smoothed along the surface with a variance in m^2 along each axis."""
        mean, each = self._mean_of_neighbors
        times = min(int(np.ceil(variance / each)), SMOOTHINGS)
        for _ in range(times):
            values = values + min(variance / (each * times), 1.0) * (mean @ values - values)
        return values

    def chords(self, samples: Integers, directions: Array) -> Array:
        """(k,): metres from samples (k,) in directions (k, 3) inside to where the body ends."""
        start, into = self.points - START * self.cells.step * self.face_normals, np.linalg.inv(self.body.matrix)
        local, number = directions @ into[:3, :3].T, np.arange(len(samples))
        found = ray_caster_of(self.body.mesh).distances(start @ into[:3, :3].T + into[:3, 3], local, samples, number)
        return np.where(np.isfinite(found), found, 0.0).astype(np.float64)

    @cached_property
    def thickness(self) -> Array:
        """(s,): metres straight down from each sample to where the body ends."""
        start, into = self.points - START * self.cells.step * self.face_normals, np.linalg.inv(self.body.matrix)
        local = start @ into[:3, :3].T + into[:3, 3], -self.face_normals @ into[:3, :3].T
        return np.asarray(ray_caster_of(self.body.mesh).nearest(*local)[1])

    @cached_property
    def across(self) -> tuple[Integers, Integers]:
        """Samples of walls less than `THIN` cells thick, and the nearest sample on the other side of each."""
        thin = np.flatnonzero(self.thickness < THIN * self.cells.step)
        ends = self.points[thin] - self.thickness[thin, None] * self.face_normals[thin]
        return thin, nearest_samples(self.points, self.face_normals, self.area, ends, -self.face_normals[thin])

    @cached_property
    def parallel(self) -> Array:
        """(k,): how parallel the two sides of a wall are at each sample of `across`, 0 to 1."""
        thin, other = self.across
        cosine = (self.face_normals[thin] * self.face_normals[other]).sum(axis=1)
        return np.asarray(np.clip((ASLANT - cosine) / (ASLANT - PARALLEL), 0.0, 1.0))

    @cached_property
    def _reading(self) -> tuple[sparse.csr_array, Array, Array, Array]:
        """See `below`; and weights and depths in cells (s, 8) of the cells that are read."""
        cells, weights = np.zeros((len(self.points), 8), np.int64), np.zeros((len(self.points), 8))
        depth, missing = np.zeros(len(self.points)), np.arange(len(self.points))
        heights = np.zeros_like(weights)
        middle = 0.5 * self.thickness / self.cells.step
        # Halfway through walls of few cells, for both sides in the same place: so the one-dimensional solutions below
        # both meet there, and are that of a slab.
        deepest = np.where(middle < MIDDLE, middle, np.maximum(2.0 * MIDDLE - middle, PROBE_DEPTHS[0]))
        # At sharp edges no point has enough cells around it: there, some will do.
        for least, target in product((LEAST_AROUND, 0.0), PROBE_DEPTHS):
            below = np.minimum(target, middle) if target < PROBE_DEPTHS[0] else deepest
            probe = self.probe(
                self.points[missing] - (below[missing] * self.cells.step)[:, None] * self.face_normals[missing]
            )
            every = self._depths(probe, missing)
            found = (probe.weights * every).sum(axis=1)
            halfway = below[missing] == middle[missing]
            taken = (probe.around > np.where(halfway, 0.0, least)) & (found > 0.3 * below[missing])
            at = missing[taken]
            cells[at], weights[at], depth[at] = probe.cells[taken], probe.weights[taken], found[taken]
            heights[at] = every[taken]
            missing = missing[~taken]
        at, nearest = self._nearest(missing)
        cells[at, 0], weights[at, 0] = nearest, 1.0
        used = weights > 0.0
        starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
        read = sparse.csr_array((weights[used], cells[used], starts), (len(self.points), self.count))
        return read, np.maximum(depth, LEAST_DEPTH) * self.cells.step, weights, heights

    @cached_property
    def inclusions(self) -> Inclusions | None:
        """Surfaces of opaque objects inside; None if there are none."""
        parts, found, areas = [], list[Triangles](), []
        for number, item in enumerate(self.opaque):
            points, normals, area = self.inside(item)
            if len(points):
                parts.append((points, normals, np.full(len(points), number)))
                found.append((*_placed(item), None))
                areas.append(area)
        if not found:
            return None
        points, normals, owner = (np.concatenate(part) for part in zip(*parts, strict=True))
        read, depth, spread = self._reads(points, -normals)
        vertices, faces, _ = joined(found, "opaque objects in a body")
        area = float(np.mean(areas))
        return Inclusions(points, normals, owner, read, depth, spread, area, RayCaster(Mesh(vertices, faces)))

    def inside(self, item: Object) -> tuple[Array, Array, float]:
        """Sample points (i, 3) of an object's surface that are in the body, normals (i, 3), and the area of each."""
        corners, faces = _placed(item)
        low, size = self.cells.low, self.cells.step * np.array(self.number.shape)
        triangles = _near_box(corners[faces], low, low + size)
        if not len(triangles):
            return np.zeros((0, 3)), np.zeros((0, 3)), 0.0
        points, normals, *_, area = _surface_samples(triangles, SAMPLES / self.cells.step**2)
        within = self._is_inside(points)
        return points[within], normals[within], area

    def _is_inside(self, points: Array) -> Mask:
        """(k,): whether places are in the body; in cells that its surface cuts, the nearest sample decides."""
        place = np.floor((points - self.cells.low) / self.cells.step).astype(np.int64)
        within = np.asarray(((place >= 0) & (place < self.number.shape)).all(axis=1), bool)
        if within.any():
            nearest = cKDTree(self.points).query(points[within])[1]
            away = points[within] - self.points[nearest]
            x, y, z = place[within].T
            filled = self._body_cells[x, y, z] > 1.0 - 1e-6
            within[within] = filled | (
                (self._body_cells[x, y, z] > 0.0) & ((away * self.face_normals[nearest]).sum(axis=1) < 0.0)
            )
        return within

    def _reads(self, points: Array, normals: Array) -> tuple[sparse.csr_array, Array, Array]:
        """Interpolation weights of the fluence near inclusions, at points (k, 3) with normals (k, 3); depth and
        `spread`.
        """
        cells, weights = np.zeros((len(points), 8), np.int64), np.zeros((len(points), 8))
        heights, missing = np.zeros((len(points), 8)), np.arange(len(points))
        places = (points - self.cells.low) / self.cells.step
        for target in PROBE_DEPTHS:
            probe = self.probe(points[missing] - target * self.cells.step * normals[missing])
            centers = self.cells.center.reshape(-1, 3)[probe.places]
            every = np.einsum("kci,ki->kc", places[missing][:, None] - centers, normals[missing])
            taken = (probe.around > LEAST_AROUND) & ((probe.weights * every).sum(axis=1) > 0.3 * target)
            at = missing[taken]
            cells[at], weights[at], heights[at] = probe.cells[taken], probe.weights[taken], every[taken]
            missing = missing[~taken]
        used = weights > 0.0
        starts = np.concatenate([[0], np.cumsum(used.sum(axis=1))])
        read = sparse.csr_array((weights[used], cells[used], starts), (len(points), self.count))
        depth = np.maximum((weights * heights).sum(axis=1), LEAST_DEPTH) * self.cells.step
        deeper = np.maximum(heights[:, None, :] - heights[:, :, None], 0.0)
        spread = np.einsum("si,sj,sij->s", weights, weights, deeper) * self.cells.step
        return read, depth, np.asarray(spread)

    @cached_property
    def reads(self) -> sparse.csr_array:
        """Interpolation weights of the fluence at all samples of the surface, and then of inclusions."""
        return (
            self.below[0]
            if self.inclusions is None
            else sparse.csr_array(sparse.vstack([self.below[0], self.inclusions.read]))
        )

    @cached_property
    def blocks(self) -> Integers:
        """(cells,): number of the block of cells that each is in, `BLOCKS` of them along the longest side."""
        side = -(-max(self.number.shape) // BLOCKS)
        x, y, z = np.nonzero(self.number >= 0)
        block = ((x // side) * BLOCKS + y // side) * BLOCKS + z // side
        return np.asarray(np.unique(block, return_inverse=True)[1])

    @cached_property
    def block_pairs(self) -> Integers:
        """(n,): pair of blocks to which each entry of the linear system belongs."""
        of = self.blocks
        return np.asarray(of[self.pattern.rows] * (of.max(initial=-1) + 1) + of[self.pattern.columns])

    @cached_property
    def pattern(self) -> MatrixPattern:
        """Sparsity pattern of the linear system of its cells."""
        return MatrixPattern.of(self)

    @cached_property
    def layers(self) -> Array:
        """(cells,): volume in m^3 of each cell that is less deep than the fluence is read, counted for each sample."""
        surfaces = [(self.points, self.face_normals, self.below[1], self.areas, self.curvature)]
        if (inner := self.inclusions) is not None:
            areas = np.full(len(inner.points), inner.area)
            surfaces.append((inner.points, -inner.normals, inner.depth, areas, np.zeros(len(areas))))
        volume = np.zeros(self.count)
        for points, normals, depth, areas, curvature in surfaces:
            for place in LAYER_PLACES:
                probe = self.probe(points - (place * depth)[:, None] * normals)
                there = areas * np.exp(-2.0 * curvature * place * depth)
                part = probe.weights * (there * depth / len(LAYER_PLACES))[:, None]
                volume += np.bincount(probe.cells.ravel(), part.ravel(), self.count)
        return volume

    @cached_property
    def crumbs(self) -> Mask:
        """(cells,): cells in parts of the grid that no sample reads."""
        first, second, _ = self.faces
        joined = sparse.coo_array((np.ones(len(first)), (first, second)), (self.count, self.count))
        parts, part = connected_components(joined, directed=False)
        read = np.bincount(part, np.asarray(self.reads.sum(axis=0)), parts) > 0.0
        return np.asarray(~read[part])

    @cached_property
    def cores(self) -> Array:
        """(cells,): volume in m^3 of each cell without its layers; with these, all are the volume of the body."""
        rest = np.maximum(self.volumes - self.layers, 0.0)
        depth = self.below[1]
        below = np.mean([np.exp(-2.0 * self.curvature * place * depth) for place in LAYER_PLACES], axis=0)
        target = self.volumes.sum() - self.areas @ (depth * below)
        if self.inclusions is not None:
            target -= self.inclusions.area * self.inclusions.depth.sum()
        return np.asarray(rest * min(max(target, 0.0) / max(rest.sum(), np.finfo(np.float64).tiny), 1.0))

    def probe(self, points: Array) -> Probe:
        """Linear interpolation at points (k, 3), in metres."""
        size = np.array(self.number.shape)
        # Cells at the sides of the grid are empty: nothing is found outside.
        place = np.clip((points - self.cells.low) / self.cells.step - 0.5, 0.0, size - 1.0)
        corner = np.minimum(place.astype(np.int64), size - 2)
        fraction = place - corner
        x, y, z = (np.stack([1.0 - part, part], axis=1) for part in fraction.T)
        flat = (corner[:, 0] * size[1] + corner[:, 1]) * size[2] + corner[:, 2]
        offsets = [(i * size[1] + j) * size[2] + k for i, j, k in np.ndindex(2, 2, 2)]
        places = flat[:, None] + np.array(offsets)
        number, inside = self._flat_cells
        weights = np.einsum("ki,kj,kl->kijl", x, y, z).reshape(-1, 8) * inside[places]
        around = weights.sum(axis=1)
        return Probe(number[places], weights / np.where(around > 0.0, around, 1.0)[:, None], places, around)

    def cell_at(self, places: Floats) -> tuple[Integers, Array]:
        """(k,), (k,): number of the cell at places (3, k) in cells, and its fraction inside; 0 outside the system."""
        number, inside = self._flat_cells
        size = self.number.shape
        # Cells at the sides of the grid are empty.
        x, y, z = (np.clip(at, 0, n - 1).astype(np.intp) for at, n in zip(places, size, strict=True))
        flat = (x * size[1] + y) * size[2] + z
        return number[flat], inside[flat]

    @cached_property
    def _flat_cells(self) -> tuple[Integers, Array]:
        """Number of each cell of the grid and its fraction inside, both 0 outside the system."""
        number = self.number.ravel()
        return np.maximum(number, 0), np.where(number >= 0, self.cells.inside.ravel(), 0.0)

    def _depths(self, probe: Probe, samples: Integers) -> Array:
        """(k, 8): depths below samples (k,) of the cells that are read, in cells."""
        places = (self.points[samples] - self.cells.low) / self.cells.step
        centers = self.cells.center.reshape(-1, 3)[probe.places]
        return np.asarray(np.einsum("kci,ki->kc", places[:, None] - centers, self.face_normals[samples]))

    def _nearest(self, samples: Integers) -> tuple[Integers, Integers]:
        """Samples (k,) without cells around the point below them, and the number of the nearest cell."""
        found = np.full(len(samples), -1)
        places, normals = (self.points[samples] - self.cells.low) / self.cells.step, self.face_normals[samples]
        for depth in (0.02, 0.25, 0.5, 0.9, 1.3):
            x, y, z = np.clip((places - depth * normals).astype(int), 0, np.array(self.number.shape) - 1).T
            found = np.where(found < 0, self.number[x, y, z], found)
        return samples[found >= 0], found[found >= 0]


@dataclass(frozen=True, eq=False)
class MatrixPattern:
    """Sparsity pattern of the linear system of a grid: entries for each cell and its neighbors.

    Attributes
    ----------
    starts, columns : (cells + 1,), (n,) int32
        Of a csr_array.
    rows : (n,) int64
    diagonal, between : (cells,), (2, faces) int64
        Where the numbers of cells stand, and those of faces between cells, on either side.
    losses : (n, s) csc_array
        From losses at the samples of the surface to numbers: each loses what is read there.
    """

    starts: npt.NDArray[np.int32]
    columns: npt.NDArray[np.int32]
    rows: Integers
    diagonal: Integers
    between: Integers
    losses: sparse.csc_array

    @classmethod
    def of(cls, grid: BodyGrid) -> MatrixPattern:
        """Pattern of a grid."""
        (first, second, _), read, count = grid.faces, grid.reads, grid.count
        # Numbers of a cell are at first in 27 places, by where the other cell is.
        flat = np.flatnonzero(grid.number.ravel() >= 0)
        width, deep = grid.number.shape[1:]
        x, rest = np.divmod(flat, width * deep)
        y, z = np.divmod(rest, deep)
        place = 9 * x + 3 * y + z

        def at(one: Integers, other: Integers) -> Integers:
            return np.asarray(27 * one + 13 + place[other] - place[one])

        each = np.diff(read.indptr).astype(np.int64)
        one, pair = expanded(read.indptr[:-1].astype(np.int64), each)
        # Of each cell that a sample reads, all that it reads.
        _, other = expanded(read.indptr[one].astype(np.int64), each[one])
        pair = np.repeat(pair, each[one])
        lost = at(read.indices[pair].astype(np.int64), read.indices[other].astype(np.int64))
        own, sides = at(np.arange(count), np.arange(count)), np.stack([at(first, second), at(second, first)])
        used = np.zeros(27 * count, bool)
        used[lost], used[own], used[sides] = True, True, True
        found, number = np.flatnonzero(used), np.cumsum(used) - 1
        rows, way = np.divmod(found, 27)
        dx, dy, dz = way // 9 - 1, way // 3 % 3 - 1, way % 3 - 1
        columns = grid.number.ravel()[flat[rows] + (dx * width + dy) * deep + dz]
        starts = np.searchsorted(rows, np.arange(count + 1))
        ends = np.concatenate([[0], np.cumsum(each**2)])
        losses = sparse.csc_array((read.data[pair] * read.data[other], number[lost], ends), (len(found), len(each)))
        return cls(starts.astype(np.int32), columns.astype(np.int32), rows, number[own], number[sides], losses)


def _placed(item: Object) -> tuple[Array, npt.NDArray[np.int32]]:
    """Vertices (n, 3) of an object after its transform, and faces (m, 3), counter-clockwise from outside."""
    corners = item.world_vertices
    faces = np.asarray(item.mesh.faces, np.int32)
    return corners, faces[:, ::-1] if item.faces_inwards else faces


def body_grid(body: Object, step: float, opaque: Sequence[Object] = ()) -> BodyGrid:
    """Grid of a closed body with cells of this side in metres, less closed opaque objects that are inside it."""
    matrix = body.matrix[:3, :3]
    corners = body.world_vertices
    faces = np.asarray(body.mesh.faces)
    if np.linalg.det(matrix) < 0.0:
        faces = faces[:, ::-1]
    whole = voxels(corners, faces, step)
    points, face_normals, face, weights, area = _surface_samples(corners[faces], SAMPLES / step**2)
    at_corners = drawn_normals(body.mesh).reshape(-1, 3, 3)
    if np.linalg.det(matrix) < 0.0:
        at_corners = at_corners[:, ::-1]
    normals = np.einsum("sc,sci->si", weights, at_corners[face]) @ np.linalg.inv(matrix)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 0.0, normals / np.where(length > 0.0, length, 1.0), face_normals)
    areas = _areas(corners[faces], points, face_normals, area)

    def cut(cells: Voxels, inside: tuple[Object, ...]) -> BodyGrid:
        counts = cells.inside > LEAST_INSIDE
        number = np.full(counts.shape, -1)
        number[counts] = np.arange(counts.sum())
        return BodyGrid(cells, number, points, face_normals, normals, area, areas, body, inside, whole.inside)

    grid, cells = cut(whole, ()), whole
    # What is around the body has no surface inside.
    if not (inside := [item for item in opaque if len(grid.inside(item)[0])]):
        return grid
    for item in inside:
        cells = without(cells, cut_cells(*_placed(item), step, cells.low, np.array(cells.inside.shape)))
    return cut(cells, tuple(opaque))


def _areas(triangles: Array, points: Array, normals: Array, mean: float) -> Array:
    """(s,): area nearest to each sample, on its side of the surface, by more samples: m^2 with this `mean`."""
    dense, dense_normals, *_ = _surface_samples(triangles, FINE / mean)
    nearest = nearest_samples(points, normals, mean, dense, dense_normals)
    counts = np.maximum(np.bincount(nearest, minlength=len(points)), LEAST_AREA * FINE)
    return np.asarray(counts * (mean * len(points) / counts.sum()))


def nearest_samples(points: Array, normals: Array, area: float, places: Array, towards: Array) -> Integers:
    """(k,): nearest of samples (s, 3) to places (k, 3) that look `towards` (k, 3), with about their normals.

    Samples that look elsewhere are as much farther away as they are wide.
    """
    size = np.sqrt(area)
    tree = cKDTree(np.concatenate([points, size * normals], axis=1))
    return np.asarray(tree.query(np.concatenate([places, size * towards], axis=1))[1], np.int64)


def _near_box(triangles: Array, low: Array, high: Array) -> Array:
    """(m, 3, 3): parts of triangles (k, 3, 3) near a box, none longer than it is wide."""
    while True:
        near = (triangles.min(axis=1) <= high).all(axis=1) & (triangles.max(axis=1) >= low).all(axis=1)
        triangles = triangles[near]
        long = np.ptp(triangles, axis=1).max(axis=1, initial=0.0) > (high - low).max()
        if not long.any():
            return triangles
        a, b, c = np.moveaxis(triangles[long], 1, 0)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([triangles[~long], *(np.stack(part, axis=1) for part in parts)])


def _surface_samples(triangles: Array, density: float) -> tuple[Array, Array, Integers, Array, float]:
    """Points, face normals, faces, barycentric weights of even samples on triangles (m, 3, 3), and the area of each."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double = np.linalg.norm(normal, axis=1)
    ends = np.cumsum(0.5 * double)
    count = int(np.ceil(ends[-1] * density))
    number = np.arange(count)
    face = np.minimum(np.searchsorted(ends, (number + 0.5) / count * ends[-1]), len(ends) - 1)
    u, v = plane_points(count).T
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
    weights = np.stack([1.0 - u - v, u, v], axis=1)
    points = np.einsum("sc,sci->si", weights, triangles[face])
    return points, normal[face] / double[face, None], face, weights, float(ends[-1]) / count


def plane_points(count: int) -> Array:
    """(count, 2): additive recurrence over the unit square (Roberts 2018, "quasirandom sequences")."""
    return np.asarray((0.5 + np.arange(count)[:, None] * [0.7548776662466927, 0.5698402909980532]) % 1.0)


def other_plane_points(count: int) -> Array:
    """(count, 2): another such recurrence, to be drawn together with `plane_points`: they are independent."""
    return np.asarray((0.5 + np.arange(count)[:, None] * [0.6287067210378087, 0.5385972572236101]) % 1.0)


def box_points(count: int) -> Array:
    """(count, 3): points of a low-discrepancy sequence in the unit cube."""
    shifts = [0.8191725133961645, 0.6710436067037893, 0.5497004779019703]
    return np.asarray((0.5 + np.arange(count)[:, None] * shifts) % 1.0)
