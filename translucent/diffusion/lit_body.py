"""Bodies in which light diffuses: what does not depend on the medium, on where they are, or on lights."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from translucent.arrays import Array, Floats, Integers, Mask
from translucent.diffusion.entering import BEFORE, Occluders, Pose, Sky, sky_of, sky_paths, transfer
from translucent.diffusion.exchange import Exchange, OpaqueSurfaces, Patches
from translucent.diffusion.first_events import EnteringRays
from translucent.diffusion.grid import BodyGrid, Densities, body_grid, densities
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import ray_caster_of
from translucent.scene.scene import Object

#: Cells by which values at the surface are spread beyond the cells that it crosses.
SPREAD = 3

#: Samples of a surface for each one at which paths through other bodies are found.
SAMPLES_FOR_PATH = 4


@dataclass(frozen=True, eq=False)
class Spreading:
    """Means of samples' values in the cells where they lie, spread to cells around. Cells farther inside have others.

    Attributes
    ----------
    means : (c, s) csr_array
        Of the samples in each of the cells that have some.
    rings : list of csr_array
        Rings of cells around the known ones, from the inside out: means of the known cells among the 26 around.
    cells : (n,) int64
        Places in the flat grid, of the cells that have samples and of each ring.
    deep, numbers : (m,), (m,) int64
        Places of the other cells in the system, and their numbers.
    shape : tuple of 3 int
    """

    means: sparse.csr_array
    rings: list[sparse.csr_array]
    cells: Integers
    deep: Integers
    numbers: Integers
    shape: tuple[int, ...]

    @classmethod
    def of(cls, grid: BodyGrid) -> Spreading:
        """Spread over a grid."""
        shape = grid.number.shape
        place = np.floor((grid.points - grid.cells.low) / grid.cells.step).astype(int)
        at = np.ravel_multi_index(tuple(np.clip(place, 0, np.array(shape) - 1).T), shape)
        cells, row, count = np.unique(at, return_inverse=True, return_counts=True)
        means = sparse.csr_array((1.0 / count[row], (row, np.arange(len(at)))), (len(cells), len(at)), np.float32)
        # The grid gets a border, in which nothing is known.
        wide = tuple(side + 2 for side in shape)
        numbered = np.full(wide, -2)
        numbered[1:-1, 1:-1, 1:-1] = -1
        flat, inner = numbered.ravel(), np.flatnonzero(numbered == -1)
        x, y, z = np.indices((3, 3, 3)).reshape(3, -1) - 1
        around = (x * wide[1] + y) * wide[2] + z
        known, rings = inner[cells], []
        last, flat[known] = known, np.arange(len(known))
        for _ in range(SPREAD):
            near = np.zeros(len(flat), bool)
            near[last[:, None] + around] = True
            last = np.flatnonzero(near & (flat == -1))
            column = flat[last[:, None] + around]
            each = (column >= 0).sum(axis=1)
            size, starts = (len(last), len(known)), np.concatenate([[0], np.cumsum(each)])
            weights = np.repeat(1.0 / each, each).astype(np.float32)
            rings.append(sparse.csr_array((weights, column[column >= 0], starts), size))
            flat[last] = len(known) + np.arange(len(last))
            known = np.concatenate([known, last])
        number = grid.number.ravel()
        deep = np.flatnonzero((flat[inner] < 0) & (number >= 0))
        place = np.zeros(len(flat), np.int64)
        place[inner] = np.arange(len(inner))
        return cls(means, rings, place[known], deep, number[deep], shape)

    def volume(self, values: Floats, deep: Floats) -> Floats:
        """(x, y, z, n) float32: values (s, n) of the samples, spread, and `deep` (cells, n) farther inside."""
        filled = self.means @ values
        for ring in self.rings:
            filled = np.concatenate([filled, ring @ filled])
        volume = np.zeros((int(np.prod(self.shape)), values.shape[1]), np.float32)
        volume[self.cells], volume[self.deep] = filled, deep[self.numbers]
        return volume.reshape(*self.shape, -1)


@dataclass(frozen=True, eq=False)
class Entrance:
    """Transfer from radiance outside to flux that enters a body through its interface.

    Attributes
    ----------
    transfer : (n,) float64
        Flux for a unit of radiance from the part of the sphere around the direction of each pair of `Sky`.
    received : (s, k) float32
        The same where the sky is visible, else 0.
    itself : (s, s) csr_array
        Form factors: for a unit of diffuse flux that leaves another sample.
    """

    transfer: Array
    received: Floats
    itself: sparse.csr_array


@dataclass(frozen=True, eq=False)
class BodyShape:
    """Grid of a body in its own frame, and what it sees of the sky and of itself there.

    Attributes
    ----------
    body : Object
        Stretched, and neither rotated nor moved.
    grid : BodyGrid
    sky : Sky
    """

    body: Object
    grid: BodyGrid
    sky: Sky
    _entrances: dict[tuple[float, float], Entrance] = field(default_factory=dict)

    @cached_property
    def spreading(self) -> Spreading:
        """From the samples of its surface to the cells around it."""
        return Spreading.of(self.grid)

    @cached_property
    def densities(self) -> Densities:
        """Densities of the body."""
        return densities(self.body, self.grid)

    def entrance(self, ior: float, roughness: float) -> Entrance:
        """Transfer through an interface with this index and roughness; the last one is cached."""
        if (ior, roughness) not in self._entrances:
            sky, count = self.sky, len(self.grid.points)
            flux = transfer(sky, count, ior, diffuse_interface(ior, roughness))
            received = np.zeros((count, len(sky.directions)), np.float32)
            received[sky.sample, sky.direction] = np.where(np.isinf(sky.distance), flux, 0.0)
            ends = np.searchsorted(sky.sample[sky.facing], np.arange(count + 1))
            itself = sparse.csr_array((flux[sky.facing] / np.pi, sky.other, ends), (count, count))
            self._entrances.clear()
            self._entrances[ior, roughness] = Entrance(flux, received, itself)
        return self._entrances[ior, roughness]


def body_shape(body: Object, step: float) -> BodyShape:
    """Shape of a body, neither rotated nor moved, with cells of this side."""
    grid = body_grid(body, step)
    return BodyShape(body, grid, sky_of(grid))


@dataclass(frozen=True, eq=False)
class LitBody:
    """A body in which light diffuses where it is, among opaque objects, for any medium and lights.

    Attributes
    ----------
    shape : BodyShape
    casters : Occluders
    arriving : OrderedDict
        Uniform flux (s, 3) and rays that enter from the last environment, and from each of the last lights, by keys.
    """

    shape: BodyShape
    casters: Occluders
    arriving: OrderedDict[Hashable, tuple[Array, EnteringRays]] = field(default_factory=OrderedDict)
    _entrances: dict[tuple[float, float], Entrance] = field(default_factory=dict)
    _sky_paths: dict[tuple[Mesh, bytes], sparse.csr_array] = field(default_factory=dict)

    @property
    def grid(self) -> BodyGrid:
        """Grid of the body in its own frame."""
        return self.shape.grid

    @property
    def pose(self) -> Pose:
        """Position and rotation of the body."""
        return self.casters.pose

    def sky_paths(self, others: Sequence[Object]) -> list[sparse.csr_array]:
        """Metres in each of other bodies on paths to the sky, see `sky_paths`; the last ones are cached."""
        places = [(body.mesh, body.matrix.tobytes()) for body in others]
        found = {
            place: self._sky_paths[place] if place in self._sky_paths else self._paths(body)
            for place, body in zip(places, others, strict=True)
        }
        self._sky_paths.clear()
        self._sky_paths.update(found)
        return [found[place] for place in places]

    def _paths(self, body: Object) -> sparse.csr_array:
        """Metres in another body, of paths from a part of the samples; all samples take those of the nearest one."""
        points, part, sky = self.grid.points, slice(None, None, SAMPLES_FOR_PATH), self.shape.sky
        nearest = cKDTree(points[part]).query(points)[1]
        # Next to an edge samples face other directions: each takes every direction that its group of samples sees.
        visible = np.zeros((len(points[part]), len(sky.directions)), bool)
        seen = np.isinf(sky.distance) & ~self._hidden
        visible[nearest[sky.sample[seen]], sky.direction[seen]] = True
        metres = sky_paths(body, self._starts[part], self.pose.outwards(sky.directions), visible)
        return sparse.csr_array(metres[nearest])

    @cached_property
    def _starts(self) -> Array:
        """(s, 3): places above the samples, in the world."""
        grid, pose = self.grid, self.pose
        return pose.outwards(grid.points + BEFORE * grid.cells.step * grid.face_normals) + pose.shift

    @cached_property
    def _hidden(self) -> Mask:
        """(n,): pairs of `Sky` in which something opaque is before the sky, or before the body itself."""
        sky, starts = self.shape.sky, self._starts
        hidden = np.zeros(len(sky.sample), bool)
        if self.casters.opaque is None:
            return hidden
        opaque = self.casters.opaque.caster
        directions, (low, high) = self.pose.outwards(sky.directions), opaque.bounds
        away = ((starts.min(axis=0) > high) & (directions >= 0.0)) | ((starts.max(axis=0) < low) & (directions <= 0.0))
        pairs = np.flatnonzero(~away.any(axis=1)[sky.direction])
        distance = opaque.distances(starts, directions, sky.sample[pairs], sky.direction[pairs])
        hidden[pairs] = distance < sky.distance[pairs]
        return hidden

    @cached_property
    def patches(self) -> Patches | None:
        """Patches of opaque surfaces that the samples see; None if there are none."""
        if self.casters.opaque is None or not self._hidden.any():
            return None
        sky, pairs = self.shape.sky, np.flatnonzero(self._hidden)
        rays = self._starts[sky.sample[pairs]], self.pose.outwards(sky.directions)[sky.direction[pairs]]
        step, samples = self.grid.cells.step, len(self.grid.points)
        return Patches.of(self.casters.opaque, pairs, rays, step, self.nearest, samples)

    def nearest(self, origins: Array, directions: Array) -> tuple[Array, Integers]:
        """Distance (k,) at which rays (k, 3), (k, 3) of the world hit the body, inf for none, and the sample there."""
        into, number = np.linalg.inv(self.casters.body.matrix), np.arange(len(origins))
        local = origins @ into[:3, :3].T + into[:3, 3], directions @ into[:3, :3].T
        distance = ray_caster_of(self.casters.body.mesh).distances(*local, number, number).astype(np.float64)
        sample, hit = np.zeros(len(origins), np.int64), np.isfinite(distance)
        places = origins[hit] + distance[hit, None] * directions[hit]
        sample[hit] = self._tree.query(self.pose.inwards(places - self.pose.shift))[1]
        return distance, sample

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.grid.points)

    def exchange(self, ior: float, roughness: float) -> Exchange:
        """Flux that enters for what leaves, through an interface with this index and roughness."""
        entrance, patches = self.entrance(ior, roughness), self.patches
        if patches is None:
            return Exchange(entrance.itself)
        seen = patches.seen(self.shape.sky.sample, entrance.transfer, len(self.grid.points))
        return Exchange(entrance.itself, patches, seen)

    def entrance(self, ior: float, roughness: float) -> Entrance:
        """Transfer through an interface with this index and roughness; the last one is cached."""
        free, hidden = self.shape.entrance(ior, roughness), self._hidden
        if not hidden.any():
            return free
        if (ior, roughness) not in self._entrances:
            sky, received, itself = self.shape.sky, free.received.copy(), free.itself.copy()
            received[sky.sample[hidden], sky.direction[hidden]] = 0.0
            itself.data[hidden[sky.facing]] = 0.0
            self._entrances.clear()
            self._entrances[ior, roughness] = Entrance(free.transfer, received, itself)
        return self._entrances[ior, roughness]


def own_frame(body: Object) -> Object:
    """The body as it is stretched, neither rotated nor moved."""
    return replace(body, transform=Pose.of(body.matrix)[1])


def lit_body(body: Object, opaque: OpaqueSurfaces | None, step: float, shape: BodyShape | None = None) -> LitBody:
    """Geometry of a body with cells of this side, shadowed by itself and by opaque surfaces.

    `shape` is that of its own frame, where it is known.
    """
    return LitBody(shape or body_shape(own_frame(body), step), Occluders(body, opaque))
