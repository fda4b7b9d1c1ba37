"""Light that bodies and opaque surfaces send each other: radiosity of the patches that a body's surface sees.

What an opaque surface reflects goes on as if it reflected diffusely, its coat and metal included. Patches are about as
wide as a cell next to the body, and farther off a part of the distance.

References
----------
Goral, Torrance, Greenberg & Battaile 1984, "Modeling the interaction of light between diffuse surfaces".
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.ndimage import convolve1d, map_coordinates
from scipy.spatial import cKDTree

from translucent.arrays import Array, Integers, Mask
from translucent.diffusion.grid import box_points, plane_points
from translucent.formulas.diffuse_interface import diffuse_interface
from translucent.geometry.mesh import Mesh, Triangles, joined
from translucent.geometry.ray_caster import RayCaster
from translucent.scene.grounds import TOLERANCE, Mirror
from translucent.scene.lights import PositionalLight
from translucent.scene.scene import Light, Object

#: Width of a patch, as a fraction of its distance from the sample that sees it.
PATCH = 0.15

#: Rays by which each patch finds the environment, the body, and other patches.
PATCH_RAYS = 32

#: Rounds of light among the patches themselves.
ROUNDS = 8

#: Texels along a side of a map of the light on a ground, and rays of each.
GROUND_TEXELS, GROUND_RAYS = 64, 48

#: Distance from its middle up to which the map of a ground is not squeezed, in half diagonals of the bodies.
GROUND_REACH = 1.5

#: Start of rays before an opaque surface, as a fraction of the size of what is there.
_BEFORE = 1e-5


class OpaqueSurfaces:
    """All opaque objects of a scene as one mesh for ray casting, with reflectance and emission.

    Parameters
    ----------
    objects : sequence of Object
        At least one of them has faces.

    Attributes
    ----------
    objects : list of Object
        Those with faces.
    caster : RayCaster
    first : (objects + 1,) int64
        Number of the first face of each object in the mesh.
    """

    def __init__(self, objects: Sequence[Object]) -> None:
        self.objects = [item for item in objects if len(item.mesh.faces)]
        parts: list[Triangles] = [(item.world_vertices, item.mesh.faces, None) for item in self.objects]
        vertices, faces, _ = joined(parts, "opaque objects")
        self.caster = RayCaster(Mesh(vertices, faces))
        self._corners = np.asarray(vertices)[np.asarray(faces)]
        self.first = np.cumsum([0, *(len(item.mesh.faces) for item in self.objects)])

    def normals(self, face: Integers) -> Array:
        """(k, 3): unit normals of faces (k,), by the order of their corners."""
        few = len(self._corners) < len(face)  # as those of a ground
        first, second, third = np.moveaxis(self._corners if few else self._corners[face], 1, 0)
        normal = np.cross(second - first, third - first)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        return np.asarray(normal[face] if few else normal)

    def light(self, face: Integers, points: Array) -> tuple[Array, Array]:
        """(k, 3), (k, 3): fraction of the light that faces (k,) reflect at points (k, 3), and emitted radiance."""
        reflected, emitted = np.zeros((2, len(face), 3))
        owner = np.searchsorted(self.first, face, side="right") - 1
        for number in np.unique(owner):
            item, at = self.objects[number], np.flatnonzero(owner == number)
            own, weights = face[at] - self.first[number], self._weights(face[at], points[at])
            color = np.broadcast_to(item.base_color, (len(at), 3))
            if item.mesh.colors is not None:
                color = color * np.einsum("kc,kci->ki", weights, item.mesh.colors[item.mesh.faces[own]])[:, :3]
            if (surface := item.surface) is None:
                reflected[at] = color
                continue
            emitted[at] = surface.emissive
            if item.mesh.uv is not None:
                uv = np.einsum("kc,kci->ki", weights, item.mesh.uv[item.mesh.faces[own]])
                if surface.color_texture is not None:
                    color = color * surface.color_texture.sample(uv)[:, :3]
                if surface.emissive_texture is not None:
                    emitted[at] *= surface.emissive_texture.sample(uv)[:, :3]
            coat = 1.0 - diffuse_interface(surface.ior).entering
            base = color * (1.0 - coat) * (1.0 - surface.diffuse_transmission) + coat
            reflected[at] = surface.metallic * color + (1.0 - surface.metallic) * base
        return reflected, emitted

    def _weights(self, face: Integers, points: Array) -> Array:
        """(k, 3): barycentric weights of points in faces."""
        first, second, third = np.moveaxis(self._corners[face], 1, 0)
        u, v, w = second - first, third - first, points - first
        uu, uv, vv, wu, wv = ((a * b).sum(axis=1) for a, b in ((u, u), (u, v), (v, v), (w, u), (w, v)))
        size = np.maximum(uu * vv - uv * uv, 1e-300)
        second_weight, third_weight = (vv * wu - uv * wv) / size, (uu * wv - uv * wu) / size
        return np.stack([1.0 - second_weight - third_weight, second_weight, third_weight], axis=1)


#: Nearest part of the body on rays (k, 3), (k, 3): distance in metres, inf where there is none, and the sample there.
BodyHits = Callable[[Array, Array], tuple[Array, Integers]]


@dataclass(frozen=True, eq=False)
class SampledSurface:
    """Surface of one body or of several, and its samples: a ray finds the sample nearest to where it hits.

    Attributes
    ----------
    nearest : BodyHits
    count : int
        Number of samples.
    """

    nearest: BodyHits
    count: int

    @classmethod
    def of_all(cls, parts: Sequence[SampledSurface], balls: Sequence[tuple[Array, float]]) -> SampledSurface:
        """Union of surfaces, each in a ball with a center and a radius; samples are numbered one after another."""
        first = np.cumsum([0, *(part.count for part in parts)])

        def nearest(origins: Array, directions: Array) -> tuple[Array, Integers]:
            distance, sample = np.full(len(origins), np.inf), np.zeros(len(origins), np.int64)
            for part, (center, radius), offset in zip(parts, balls, first[:-1], strict=True):
                towards = center - origins
                along, square = (towards * directions).sum(axis=1), (towards**2).sum(axis=1)
                may = np.flatnonzero((square - along**2 <= radius**2) & ((along > 0.0) | (square <= radius**2)))
                found, own = part.nearest(origins[may], directions[may])
                closer = found < distance[may]
                distance[may[closer]], sample[may[closer]] = found[closer], offset + own[closer]
            return distance, sample

        return cls(nearest, int(first[-1]))


@dataclass(frozen=True, eq=False)
class Patches:
    """Patches of opaque surfaces that are visible from the samples of a body, and their own visibility.

    Attributes
    ----------
    points, normals : (p, 3) float64
        In the world; normals are towards the body.
    reflected, emitted : (p, 3) float64
        Fraction of the light that goes on, and radiance.
    pairs, patch : (n,) int64
        Numbers of pairs of a sample and a direction, as of `Sky`, and the patch that each sees.
    from_body : (p, s) csr_array
        Irradiance of each patch for a unit of flux that leaves each sample.
    from_others : (p, o) csr_array
        The same for the samples of other bodies.
    among : (p, p) csr_array
        The same of patches for each other.
    free, directions : (m,) int64, (m, 3) float64
        Patch, and direction, of the rays that see the environment, `PATCH_RAYS` of each patch in all.
    """

    points: Array
    normals: Array
    reflected: Array
    emitted: Array
    pairs: Integers
    patch: Integers
    from_body: sparse.csr_array
    from_others: sparse.csr_array
    among: sparse.csr_array
    free: Integers
    directions: Array

    @classmethod
    def of(
        cls,
        surfaces: OpaqueSurfaces,
        pairs: Integers,
        rays: tuple[Array, Array],
        step: float,
        body: SampledSurface,
        others: SampledSurface,
    ) -> Patches:
        """Patches that rays (n, 3), (n, 3) of numbered pairs of a body hit; `step` is the side of a cell."""
        origins, directions = rays
        face, distance = surfaces.caster.nearest(origins, directions)
        hit = face >= 0
        pairs, face, distance = pairs[hit], face[hit], distance[hit]
        places = origins[hit] + distance[:, None] * directions[hit]
        normals = surfaces.normals(face)
        normals = np.where((normals * directions[hit]).sum(axis=1, keepdims=True) > 0.0, -normals, normals)
        first, patch = _grouped(places, normals, distance, step)
        points, normals, face = places[first], normals[first], face[first]
        reflected, emitted = surfaces.light(face, points)
        owner, towards = hemispheres(normals, PATCH_RAYS)
        start = (points + _BEFORE * distance[first, None] * normals)[owner]
        (own, sample), (other, part) = (surface.nearest(start, towards) for surface in (body, others))
        opaque = surfaces.caster.nearest(start, towards)[1]
        there = np.isfinite(opaque) & (opaque <= np.minimum(own, other))
        here, beside = (own < opaque) & (own <= other), (other < opaque) & (other < own)
        ends = start[there] + opaque[there, None] * towards[there]
        nearest = cKDTree(points).query(ends)[1] if there.any() else np.zeros(0, np.int64)

        def factors(rays: Mask, column: Integers, columns: int) -> sparse.csr_array:
            weight = np.full(len(column), 1.0 / PATCH_RAYS)
            return sparse.csr_array((weight, (owner[rays], column)), (len(points), columns), np.float64)

        return cls(
            points,
            normals,
            reflected,
            emitted,
            pairs,
            patch,
            factors(here, sample[here], body.count),
            factors(beside, part[beside], others.count),
            factors(there, nearest, len(points)),
            owner[free := ~here & ~beside & ~there],
            towards[free],
        )

    def from_sky(self, radiance: Callable[[Array], Array]) -> Array:
        """(p, 3): irradiance from an environment, whose radiance (m, 3) in directions (m, 3) a function gives."""
        found = radiance(self.directions) * (np.pi / PATCH_RAYS)
        count = len(self.points)
        return np.stack([np.bincount(self.free, found[:, channel], count) for channel in range(3)], axis=1)

    def radiosity(self, irradiance: Array) -> Array:
        """(p, 3): flux that leaves patches, for an irradiance (p, 3) from lights and environment."""
        first = np.pi * self.emitted + self.reflected * irradiance
        return np.stack([self.sent(first[:, channel], channel) for channel in range(3)], axis=1)

    def sent(self, first: Array, channel: int) -> Array:
        """(p,): flux that leaves patches in a color channel, for one (p,) that leaves them for the first time."""
        total = first
        for _ in range(ROUNDS if self.among.nnz else 0):
            total = first + self.reflected[:, channel] * (self.among @ total)
        return np.asarray(total)

    def seen(self, sample: npt.NDArray[np.integer], flux: Array, samples: int) -> sparse.csr_array:
        """(s, p): flux that enters at samples for the radiosity of patches, by the transfer (n,) of all pairs."""
        values = np.asarray(flux[self.pairs], np.float64) / np.pi
        return sparse.csr_array((values, (sample[self.pairs], self.patch)), (samples, len(self.points)))


def _grouped(places: Array, normals: Array, distance: Array, step: float) -> tuple[Integers, Integers]:
    """Index of the first hit of each patch, and the patch of each hit: hits (n, 3) in one cell of one size and side."""
    level = np.floor(np.log2(np.maximum(PATCH * distance / step, 1.0)))
    cell = np.floor(places / (step * 2.0**level)[:, None])
    axis = np.abs(normals).argmax(axis=1)
    side = 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0.0)
    key, count = np.zeros(len(places)), 1.0
    for column in (*cell.T, 8.0 * level + side):  # one number is sorted faster than rows of four
        number = column - column.min(initial=np.inf)
        most = number.max(initial=0.0) + 1.0
        if not count * most < 2.0**53:
            key, number = (np.unique(one, return_inverse=True)[1].astype(np.float64) for one in (key, number))
            count, most = key.max() + 1.0, number.max() + 1.0
        key, count = key + count * number, count * most
    _, first, patch = np.unique(key, return_index=True, return_inverse=True)
    return first, patch


def hemispheres(normals: Array, rays: int) -> tuple[Integers, Array]:
    """Number of the patch, and direction, of so many rays of each, distributed as the cosine with its normal (k, 3)."""
    count = len(normals)
    shift, first = box_points(count)[:, None, :2], plane_points(rays)[None]
    owner, (u, v) = np.repeat(np.arange(count), rays), np.moveaxis((first + shift).reshape(-1, 2) % 1.0, -1, 0)
    return owner, cosine_directions(normals[owner], u, v)


def cosine_directions(normals: Array, u: Array, v: Array) -> Array:
    """(k, 3): directions by numbers (k,), (k,) from 0 to 1, distributed as the cosine with normals (k, 3)."""
    level, angle = np.sqrt(u), 2.0 * np.pi * v
    across, along = tangents(normals)
    sideways = (level * np.cos(angle))[:, None] * across + (level * np.sin(angle))[:, None] * along
    return np.asarray(sideways + np.sqrt(1.0 - u)[:, None] * normals)


def tangents(normals: Array) -> tuple[Array, Array]:
    """(k, 3), (k, 3): two unit vectors at right angles to unit vectors (k, 3), and to each other."""
    aside = np.where(np.abs(normals[:, :1]) < 0.7, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    across = np.cross(normals, aside)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(normals, across)


def direct_irradiance(
    points: Array,
    normals: Array,
    lights: Sequence[Light],
    opaque: RayCaster,
    passed: Callable[[Array, Array, Array], Array],
) -> Array:
    """(p, 3): irradiance of lights on points (p, 3) of opaque surfaces, which shadow each other.

    `passed` is the transmittance (k, 3) of what else is on paths from points in directions over distances.
    """
    total = np.zeros(points.shape)
    for light in lights:
        if isinstance(light, PositionalLight):
            towards = np.asarray(light.position) - points
            distance = np.linalg.norm(towards, axis=1)
            directions = towards / np.maximum(distance, 1e-18)[:, None]
        else:
            directions = np.broadcast_to(-np.asarray(light.direction), points.shape)
            distance = np.full(len(points), np.inf)
        lit = np.flatnonzero((directions * normals).sum(axis=1) > 0.0)
        start = points[lit] + _BEFORE * opaque.radius * normals[lit]
        lit, start = (part[opaque.nearest(start, directions[lit])[1] >= distance[lit]] for part in (lit, start))
        found = np.asarray(light.irradiance_on(points[lit], normals[lit]), np.float64)
        total[lit] += found * passed(start, directions[lit], distance[lit])
    return total


@dataclass(frozen=True, eq=False)
class Exchange:
    """Flux that enters a body for the flux that leaves it: straight, and by way of opaque surfaces.

    Attributes
    ----------
    itself : (s, s) csr_array
        Form factors of the body's own samples.
    patches : Patches, optional
        Of the opaque surfaces that it sees.
    seen : (s, p) csr_array, optional
        See `Patches.seen`.
    others : (s, o) csr_array, optional
        Form factors of the samples of other bodies.
    behind : (s, o) csr_array, optional
        The same where something blocks the sky behind them. Elsewhere, rays from the sky through these bodies are
        already counted as the light that passes.
    """

    itself: sparse.csr_array
    patches: Patches | None = None
    seen: sparse.csr_array | None = None
    others: sparse.csr_array | None = None
    behind: sparse.csr_array | None = None

    @property
    def any(self) -> bool:
        """True if light that leaves the body falls on it again."""
        return bool(self.itself.nnz or self.patches is not None)

    def received(self, radiosity: Array) -> Array:
        """(s, 3): flux that enters for a radiosity (p, 3) of the patches."""
        assert self.seen is not None
        return np.asarray(self.seen @ radiosity)

    def returned(self, leaving: Array, channel: int) -> Array:
        """(s,): flux that enters in a color channel for a flux (s,) that leaves."""
        total = self.itself @ leaving
        if self.patches is not None:
            total = total + self._by_patches(self.patches.from_body @ leaving, channel)
        return np.asarray(total)

    def from_others(self, leaving: Array, passing: Array) -> Array:
        """(s, 3): flux that enters for fluxes (o, 3) that leave other bodies, scattered and unscattered."""
        total = np.zeros((self.itself.shape[0], 3))
        if self.others is not None and self.behind is not None:
            total += self.others @ leaving + self.behind @ passing
        if self.patches is not None:
            received = self.patches.from_others @ (leaving + passing)
            total += np.stack([self._by_patches(received[:, channel], channel) for channel in range(3)], axis=1)
        return total

    def _by_patches(self, received: Array, channel: int) -> Array:
        """(s,): flux that enters in a color channel for an irradiance (p,) of the patches."""
        assert self.patches is not None
        assert self.seen is not None
        return np.asarray(self.seen @ self.patches.sent(self.patches.reflected[:, channel] * received, channel))


@dataclass(frozen=True, eq=False)
class GroundMap:
    """Irradiance on a flat ground by bodies: light that they send minus light that they block (``ground_light.glsl``).

    Attributes
    ----------
    number : int
        Of the ground.
    normal : (3,) float64
    height : float
        Along the normal, in metres from the world's origin.
    middle : (3,) float64
        Of the map on the ground.
    axes : (2, 3) float64
        Along the map, as long as where squeezing begins.
    values : (n, n, 3) float64
        Rows along the second axis.
    """

    number: int
    normal: Array
    height: float
    middle: Array
    axes: Array
    values: Array

    def irradiance(self, points: Array, normals: Array) -> Array:
        """(k, 3): at points (k, 3) of the world with unit normals (k, 3); 0 off the ground."""
        reach = np.linalg.norm(self.axes[0])
        at = (points - self.middle) @ (self.axes / reach**2).T
        size = np.abs(at)
        place = np.where(size > 1.0, np.sign(at) * (1.0 - 0.5 / np.maximum(size, 1.0)), 0.5 * at)
        texel = ((0.5 + 0.5 * place) * len(self.values) - 0.5)[:, ::-1].T
        on = (np.abs(points @ self.normal - self.height) <= TOLERANCE * reach) & (normals @ self.normal > 0.0)
        values = [
            map_coordinates(channel, texel, order=1, mode="nearest") for channel in np.moveaxis(self.values, -1, 0)
        ]
        return np.asarray(np.where(on[:, None], np.stack(values, axis=1), 0.0))


class GroundPoints:
    """Points of a ground, one for each texel of its map, and rays from them to a body.

    Parameters
    ----------
    ground : Mirror
    number : int
        Of the ground in its scene.
    bounds : (2, 3) float64
        Of all bodies.
    """

    def __init__(self, ground: Mirror, number: int, bounds: Array) -> None:
        low, high = bounds
        size = GROUND_REACH * 0.5 * float(np.linalg.norm(high - low)) or 1.0
        across, along = (one[0] for one in tangents(ground.normal[None]))
        middle = 0.5 * (low + high)
        self.number, self.normal, self.height = number, ground.normal, ground.height
        self.middle = middle + (ground.height - middle @ ground.normal) * ground.normal
        self.axes = size * np.stack([across, along])
        place = (np.arange(GROUND_TEXELS) + 0.5) / GROUND_TEXELS * 2.0 - 1.0
        away = np.abs(place)
        at = np.where(away > 0.5, np.sign(place) * 0.5 / np.maximum(1.0 - away, 1e-6), 2.0 * place)
        x, y = np.meshgrid(at, at)
        self.points = self.middle + x.reshape(-1, 1) * self.axes[0] + y.reshape(-1, 1) * self.axes[1]

    def irradiance(self, ball: tuple[Array, float], body: BodyHits, light: Callable[[Integers, Array], Array]) -> Array:
        """(texels, 3): irradiance by a body in a ball of this center and radius.

        `light` gives the radiance (k, 3) of its samples (k,), for rays that come to them in directions (k, 3).
        """
        center, radius = ball
        start = self.points + _BEFORE * radius * self.normal
        towards = center - start
        distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-18)
        sine = np.minimum(radius / distance, 1.0)
        # Uniform over the cone around the ball, or over the hemisphere within it.
        least = np.where(sine < 1.0, np.sqrt(1.0 - sine * sine), 0.0)
        axis = np.where(sine[:, None] < 1.0, towards / distance[:, None], self.normal)
        across, along = tangents(axis)
        shifts = box_points(len(start))[:, None, :2]
        u, v = np.moveaxis((plane_points(GROUND_RAYS)[None] + shifts) % 1.0, -1, 0)
        cosine = 1.0 - u * (1.0 - least[:, None])
        level, angle = np.sqrt(1.0 - cosine**2), 2.0 * np.pi * v
        directions = (
            cosine[..., None] * axis[:, None]
            + (level * np.cos(angle))[..., None] * across[:, None]
            + (level * np.sin(angle))[..., None] * along[:, None]
        )
        facing = directions @ self.normal
        texel, ray = np.nonzero(facing > 0.0)
        found, sample = body(start[texel], directions[texel, ray])
        hit = np.isfinite(found)
        texel, ray, sample = texel[hit], ray[hit], sample[hit]
        weight = facing[texel, ray] * 2.0 * np.pi * (1.0 - least[texel]) / GROUND_RAYS
        values = light(sample, directions[texel, ray]) * weight[:, None]
        count = len(self.points)
        return np.stack([np.bincount(texel, values[:, channel], count) for channel in range(3)], axis=1)

    def map(self, irradiance: Array) -> GroundMap:
        """Map of an irradiance (texels, 3): each texel has other rays, and a mean over its neighbors is smooth."""
        values = irradiance.reshape(GROUND_TEXELS, GROUND_TEXELS, 3)
        for axis in range(2):
            values = convolve1d(values, (0.25, 0.5, 0.25), axis, mode="nearest")
        return GroundMap(self.number, self.normal, self.height, self.middle, self.axes, values)
