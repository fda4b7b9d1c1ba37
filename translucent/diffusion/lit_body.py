"""Diffusion bodies: everything that does not depend on the medium, on the position of the body, or on lights."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from translucent.arrays import Array, Floats, Integers, Mask
from translucent.diffusion.densities import Densities, densities
from translucent.diffusion.entering import (
    BEFORE,
    Occluders,
    Pose,
    Sky,
    bounding_ball,
    may_hit,
    sky_of,
    sky_paths,
    transfer,
)
from translucent.diffusion.entering_rays import EnteringRays
from translucent.diffusion.exchange import Exchange, OpaqueSurfaces, Patches, SampledSurface
from translucent.diffusion.grid import BodyGrid, body_grid
from translucent.diffusion.sides import SurfaceSides
from translucent.diffusion.walls import Walls
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import ray_caster_of
from translucent.scene.scene import Object

#: Samples of a surface for each one at which paths through other bodies are found.
SAMPLES_FOR_PATH = 4

#: Form factor of a body, seen from the middle of another one, below which it does not light that one.
LEAST_FACTOR = 0.01

#: Number of samples of a body that are tested for being inside another one.
INSIDE = 7

#: Samples of inclusions that a cell near them takes the mean of, and their largest distance in cells.
AROUND_CELL, REACH = 8, 3.0


@dataclass(frozen=True, eq=False)
class Entrance:
    """Transfer from radiance outside to flux that enters a body through its interface.

    Attributes
    ----------
    transfer : (n,) float64
        Flux for a unit of radiance from the part of the sphere around the direction of each pair of `Sky`.
    received : (s, k) float32
        The same for each sample and each direction of `Sky` where the sky is visible, else 0.
    itself : (s, s) csr_array
        Form factors: for a unit of diffuse flux that leaves another sample.
    """

    transfer: Array
    received: Floats
    itself: sparse.csr_array


@dataclass(frozen=True, eq=False)
class BodyShape:
    """Diffusion grid of a body in its own frame, with its visibility of the sky and of itself.

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
    def sides(self) -> SurfaceSides:
        """From the samples of its surface to the cells around it."""
        return SurfaceSides.of(self.grid)

    def on_inclusions(self, values: Array) -> Floats:
        """(x, y, z, n) float32: values (i, n) at the samples of opaque objects inside, in the cells around these."""
        grid, inner = self.grid, self.grid.inclusions
        volume = np.zeros((grid.number.size, values.shape[1]), np.float32)
        if inner is not None:
            centers = np.indices(grid.number.shape).reshape(3, -1).T + 0.5
            found, sample = inner.tree.query(
                grid.cells.low + grid.cells.step * centers, AROUND_CELL, distance_upper_bound=REACH * grid.cells.step
            )
            near = np.isfinite(found)
            weight = np.where(near, 1.0 / (np.where(near, found / grid.cells.step, 1.0) ** 2 + 0.25), 0.0)
            total, own = weight.sum(axis=1, keepdims=True), near.any(axis=1)
            part = weight[own] / total[own]
            volume[own] = np.einsum("ck,ckn->cn", part, values[np.where(near, sample, 0)[own]])
        return volume.reshape(*grid.number.shape, -1)

    @cached_property
    def densities(self) -> Densities:
        """Densities of the body."""
        return densities(self.body, self.grid)

    @cached_property
    def walls(self) -> Walls:
        """Walls of the body."""
        return Walls.of(self.grid)

    def entrance(self, ior: float, roughness: float) -> Entrance:
        """Transfer through an interface with this index and roughness; the last one is cached."""
        if (ior, roughness) not in self._entrances:
            sky, count = self.sky, len(self.grid.points)
            flux = transfer(sky, count, ior, diffuse_interface(ior, roughness))
            received, free = np.zeros((count, len(sky.directions)), np.float32), np.isinf(sky.distance)
            received[sky.sample[free], sky.direction[free]] = flux[free]
            ends = np.searchsorted(sky.sample[sky.facing], np.arange(count + 1))
            itself = sparse.csr_array((flux[sky.facing] / np.pi, sky.other, ends), (count, count))
            self._entrances.clear()
            self._entrances[ior, roughness] = Entrance(flux, received, itself)
        return self._entrances[ior, roughness]


def body_shape(body: Object, step: float, opaque: Sequence[Object] = ()) -> BodyShape:
    """Shape of a body, neither rotated nor moved, with cells of this side, around `inclusions_of` it."""
    grid = body_grid(body, step, opaque)
    return BodyShape(body, grid, sky_of(grid))


@dataclass(frozen=True, eq=False)
class LitBody:
    """Diffusion body at its position among opaque objects, for any medium and lights.

    Attributes
    ----------
    shape : BodyShape
    casters : Occluders
    others : tuple of LitBody
        Other bodies whose light it receives.
    arriving : OrderedDict
        Uniform flux (s, 3) and rays that enter from the last environment, and from each of the last lights, by keys.
    """

    shape: BodyShape
    casters: Occluders
    others: tuple[LitBody, ...] = ()
    arriving: OrderedDict[Hashable, tuple[Array, EnteringRays]] = field(default_factory=OrderedDict)
    _entrances: dict[tuple[float, float], Entrance] = field(default_factory=dict)
    _exchanges: dict[tuple[float, float], Exchange] = field(default_factory=dict)
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
        """Metres that paths from some samples cross in another body; all samples use the nearest of these paths."""
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
    def _seen(self) -> tuple[Integers, Integers]:
        """Pairs (k,) of `Sky` that hit another body before all else, and its sample, numbered as in `_all_others`."""
        if not self.others:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        sky, starts, directions = self.shape.sky, self._starts, self.pose.outwards(self.shape.sky.directions)
        near = np.zeros((len(starts), len(directions)), bool)
        for other in self.others:
            near |= may_hit(other.casters.body, starts, directions)
        pairs = np.flatnonzero(near[sky.sample, sky.direction])
        distance, part = self._all_others.nearest(starts[sky.sample[pairs]], directions[sky.direction[pairs]])
        first = distance < sky.distance[pairs]
        pairs, distance, part = pairs[first], distance[first], part[first]
        blocked = np.flatnonzero(self._hidden[pairs])
        if self.casters.opaque is not None and len(blocked):
            opaque, of = self.casters.opaque.caster, pairs[blocked]
            before = opaque.distances(starts, directions, sky.sample[of], sky.direction[of]) < distance[blocked]
            pairs, part = (np.delete(one, blocked[before]) for one in (pairs, part))
        return pairs, part

    @cached_property
    def _all_others(self) -> SampledSurface:
        return SampledSurface.of_all(
            [body.surface for body in self.others], [bounding_ball(body.casters.body) for body in self.others]
        )

    @property
    def surface(self) -> SampledSurface:
        """Surface of the body with its samples, for rays in the world."""
        return SampledSurface(self.nearest, len(self.grid.points))

    @cached_property
    def patches(self) -> Patches | None:
        """Patches of opaque surfaces that the samples see; None if there are none."""
        if self.casters.opaque is None or not self._hidden.any():
            return None
        sky, pairs = self.shape.sky, np.setdiff1d(np.flatnonzero(self._hidden), self._seen[0], assume_unique=True)
        rays = self._starts[sky.sample[pairs]], self.pose.outwards(sky.directions)[sky.direction[pairs]]
        return Patches.of(self.casters.opaque, pairs, rays, self.grid.cells.step, self.surface, self._all_others)

    def nearest(self, origins: Array, directions: Array) -> tuple[Array, Integers]:
        """Distance (k,) at which rays (k, 3), (k, 3) of the world hit the body, inf for none, and the sample there."""
        into, number = np.linalg.inv(self.casters.body.matrix), np.arange(len(origins))
        local = origins @ into[:3, :3].T + into[:3, 3], directions @ into[:3, :3].T
        distance = ray_caster_of(self.casters.body.mesh).distances(*local, number, number).astype(np.float64)
        sample, hit = np.zeros(len(origins), np.int64), np.isfinite(distance)
        places = origins[hit] + distance[hit, None] * directions[hit]
        sample[hit] = self.nearest_sample(places)
        return distance, sample

    def nearest_sample(self, places: Array) -> Integers:
        """(k,): sample nearest to places (k, 3) of the world."""
        return np.asarray(self._tree.query(self.pose.inwards(places - self.pose.shift))[1], np.int64)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.grid.points)

    def exchange(self, ior: float, roughness: float) -> Exchange:
        """Flux that enters the body for flux that leaves it, by index and roughness; the last one is cached."""
        if (ior, roughness) not in self._exchanges:
            self._exchanges.clear()
            self._exchanges[ior, roughness] = self._exchange(ior, roughness)
        return self._exchanges[ior, roughness]

    def _exchange(self, ior: float, roughness: float) -> Exchange:
        entrance, patches, sky, samples = (
            self.entrance(ior, roughness),
            self.patches,
            self.shape.sky,
            len(self.grid.points),
        )
        seen = None if patches is None else patches.seen(sky.sample, entrance.transfer, samples)
        pairs, part = self._seen
        if not len(pairs):
            return Exchange(entrance.itself, patches, seen)
        # The environment's light that others let through comes along rays already.
        behind = self._hidden[pairs] | np.isfinite(sky.distance[pairs])
        shape = samples, self._all_others.count
        others, behind = (
            sparse.csr_array((entrance.transfer[used] / np.pi, (sky.sample[used], at)), shape)
            for used, at in ((pairs, part), (pairs[behind], part[behind]))
        )
        return Exchange(entrance.itself, patches, seen, others, behind)

    def entrance(self, ior: float, roughness: float) -> Entrance:
        """Transfer through an interface with this index and roughness; the last one is cached."""
        free, hidden, (seen, _) = self.shape.entrance(ior, roughness), self._hidden, self._seen
        if not hidden.any() and not len(seen):
            return free
        if (ior, roughness) not in self._entrances:
            sky, itself, other = self.shape.sky, free.itself.copy(), np.zeros(len(hidden), bool)
            received = free.received.copy()
            received[sky.sample[hidden], sky.direction[hidden]] = 0.0
            other[seen] = True
            itself.data[(hidden | other)[sky.facing]] = 0.0
            self._entrances.clear()
            self._entrances[ior, roughness] = Entrance(free.transfer, received, itself)
        return self._entrances[ior, roughness]


def own_frame(body: Object) -> Object:
    """The body with the stretch of its transform, but without rotation and translation."""
    return replace(body, transform=Pose.of(body.matrix)[1])


def inclusions_of(body: Object, opaque: Sequence[Object]) -> tuple[Object, ...]:
    """Closed opaque objects that may be inside a body, in its own frame."""
    pose, (low, high) = Pose.of(body.matrix)[0], body.bounds
    into = np.eye(4)
    into[:3, :3], into[:3, 3] = pose.turn.T, -pose.shift @ pose.turn
    return tuple(
        replace(item, transform=into @ item.matrix, shadow_catcher=False)
        for item in opaque
        if (item.bounds[0] < high).all() and (item.bounds[1] > low).all() and item.mesh.diagnosis.solid
    )


def inclusion_colors(grid: BodyGrid, opaque: Sequence[Object]) -> Array:
    """(i, 3): fraction of the light that opaque objects inside a body reflect, at the samples of their surfaces.

    A surface reflects there as its base color, whatever its coat: the medium has nearly its index.
    """
    if grid.inclusions is None:
        return np.zeros((0, 3))
    return np.array([item.base_color for item in opaque])[grid.inclusions.owner]


def lit_body(body: Object, opaque: OpaqueSurfaces | None, step: float) -> LitBody:
    """Geometry of a body with cells of this side, shadowed by itself and by opaque surfaces."""
    return LitBody(body_shape(own_frame(body), step), Occluders(body, opaque))


def may_light(other: LitBody, body: LitBody) -> bool:
    """True if `other` looks large enough from a body to light it, and does not enclose that body."""
    (middle, radius), (center, _) = bounding_ball(other.casters.body), bounding_ball(body.casters.body)
    if radius**2 < LEAST_FACTOR * ((middle - center) ** 2).sum():
        return False
    points = body.grid.points[:: len(body.grid.points) // INSIDE + 1]
    places = body.pose.outwards(points) + body.pose.shift
    return float(np.median([abs(other.casters.body.winding_number(place)) for place in places])) < 0.5
