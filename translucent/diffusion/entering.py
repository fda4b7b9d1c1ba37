"""Light that enters a body through its surface: from the environment, from lights, and from itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import combinations_with_replacement
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.spatial import cKDTree

from translucent.arrays import Array, Floats, Integers, Mask
from translucent.diffusion.entering_rays import EnteringRays, joined_rays, two_directions, two_of_many
from translucent.diffusion.exchange import OpaqueSurfaces
from translucent.diffusion.grid import BodyGrid, nearest_samples
from translucent.diffusion.keys import may_dim
from translucent.diffusion.photons import EnteringPhotons
from translucent.formulas import optics
from translucent.formulas.diffuse_interface import DiffuseInterface, diffuse_interface
from translucent.formulas.interface import refracted_direction
from translucent.geometry.ray_caster import RayCaster, dot, ray_caster_of, unit
from translucent.scene.environment import Environment
from translucent.scene.environment_map import EnvironmentMap, row_solid_angles, texel_directions
from translucent.scene.lights import DirectionalLight, PositionalLight
from translucent.scene.scene import Light, Object, Scene

#: Faces of one body on a line that are looked for.
MOST_FACES = 64

#: Squared radius of a ball that has all of a mesh in it, in units of half the diagonal of its box, with rounding.
_BALL = 1.0 + 1e-6


def dimming_bodies(scene: Scene, body: int) -> list[Object]:
    """Other closed bodies that absorb or scatter light on its path to a body."""
    return [item for i, item in enumerate(scene.objects) if i != body and may_dim(item) and item.mesh.diagnosis.solid]


def light_passed(bodies: Sequence[Object], points: Array, directions: Array, distance: Array) -> Array:
    """Transmittance (k, 3) from points (k, 3) in unit directions (k, 3) over distances (k,) in metres, or inf.

    As in shadows, interfaces neither refract nor reflect the light, and where bodies overlap their optical depths
    add up.
    """
    depth = np.zeros((len(points), 3))
    for body in bodies:
        assert body.medium is not None
        depth += path_inside(body, points, directions, distance)[:, None] * np.asarray(body.medium.extinction)
    return optics.transmittance(depth)


def sky_paths(body: Object, points: Array, directions: Array, visible: Mask) -> sparse.csr_array:
    """(s, k): metres in another body from points (s, 3) in unit directions (k, 3) that are `visible`."""
    sample, direction = np.nonzero(visible & may_hit(body, points, directions))
    metres = path_inside(body, points[sample], directions[direction], np.full(len(sample), np.inf))
    crossed = metres > 0.0
    return sparse.csr_array((metres[crossed], (sample[crossed], direction[crossed])), visible.shape)


def may_hit(body: Object, points: Array, directions: Array) -> Mask:
    """(s, k): whether rays from points (s, 3) in unit directions (k, 3) hit the ball around a body."""
    center, radius = bounding_ball(body)
    towards = center - points
    along, square = towards @ directions.T, (towards**2).sum(axis=1)[:, None]
    return np.asarray((square - along**2 <= radius**2) & ((along > 0.0) | (square <= radius**2)))


def bounding_ball(body: Object) -> tuple[Array, float]:
    """Center and radius of a ball around a body."""
    corners = body.world_vertices
    center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    return center, float(np.sqrt(((corners - center) ** 2).sum(axis=1).max()))


def path_inside(body: Object, points: Array, directions: Array, distance: Array) -> Array:
    """(k,): metres inside a body from points (k, 3) in directions (k, 3), up to distances (k,)."""
    line, reached, sign = _crossings(body, points, directions)
    end = np.minimum(reached, distance[line])
    return np.asarray(np.maximum(np.bincount(line, sign * end, len(points)), 0.0))


def windings_at(scene: Scene, points: Array, directions: Array) -> npt.NDArray[np.int16]:
    """(k, objects): how often points (k, 3) are in each body that is no sheet, by rays in directions (k, 3)."""
    found = np.zeros((len(points), len(scene.objects)), np.int16)
    for i, body in enumerate(scene.objects):
        if body.medium is not None and body.sheet_thickness is None and not body.covers:
            line, _, sign = _crossings(body, points, directions)
            found[:, i] = np.maximum(np.rint(np.bincount(line, sign, len(points))), 0)
    return found


def _crossings(body: Object, points: Array, directions: Array) -> tuple[Integers, Array, Array]:
    """Lines (n,) of k that cross a face of a body ahead, metres to there, and 1 where they leave it, -1 to enter."""
    mesh, linear = body.mesh, body.matrix[:3, :3]
    caster = ray_caster_of(mesh)
    # Most lines pass the ball around the body.
    reach = _BALL * (float(np.linalg.norm(linear, 2)) * caster.radius) ** 2
    middle = body.matrix[:3, 3] + linear @ caster.center - points
    along, square = dot(middle, directions), dot(middle, middle)
    near = np.flatnonzero((square - along**2 <= reach) & ((along > 0.0) | (square <= reach)))
    into = np.linalg.inv(linear)
    origins, local_directions = (points[near] - body.matrix[:3, 3]) @ into.T, directions[near] @ into.T
    places, towards = (origins - caster.center) / caster.radius, unit(local_directions)
    of, face = caster.candidates(places, towards, np.full(len(near), MOST_FACES), np.ones(len(mesh.faces), dtype=bool))
    first, second, third = (mesh.vertices[mesh.faces[face, corner]] for corner in range(3))
    normal = np.cross(second - first, third - first)
    slope = dot(local_directions[of], normal)
    reached = dot(first - origins[of], normal) / np.where(slope == 0.0, np.inf, slope)
    ahead = reached > 0.0
    # Inside a body as often as faces ahead are exits, less entries; each that is passed changes that.
    sign = np.sign(slope)[ahead] * (-1.0 if mesh.diagnosis.inverted else 1.0)
    return near[of[ahead]], reached[ahead], sign


#: Directions in which each sample looks for the environment and for other parts of the body.
DIRECTIONS = 128

#: Rows of the map whose texels are shared out among these directions.
MAP_HEIGHT = 96

#: Start of shadow rays before the surface, as a fraction of a cell.
BEFORE = 1e-4

#: Least height of a light above the samples that it lights, in radii of the area of each, and how far to the side that
#: counts, in such heights. The first is about a cell: the samples then find its light within a tenth (sd 3 %).
_WIDTH, _REACH = 3.0, 3.0

#: Radiance of an environment's picture, in units of its mean, above which light counts as that of a sun.
SUN = 16.0

#: Fraction of the light that may be rounding.
_ROUNDING = 1e-6

#: Pairs of a sample and a direction that are looked at at a time.
_TOGETHER = 1 << 15

#: Digits to which the stretch of a body is rounded, so that it does not depend on its rotation, and the least size of
#: a body along one axis over that along another up to which this is done.
_DIGITS, _LEAST_STRETCH = 12, 1e-6

#: Bounds of the correction by which a quadrature over directions gives the known fraction of uniform light.
_CORRECTION = (0.5, 2.0)


@dataclass(frozen=True, eq=False)
class Pose:
    """Rotation or reflection, and translation, from a stretched body to the world.

    Its light depends on the stretch, and on where what lights it is as seen from there.

    Attributes
    ----------
    turn : (3, 3) float64
    shift : (3,) float64
    """

    turn: Array
    shift: Array

    @classmethod
    def of(cls, matrix: Array) -> tuple[Pose, Array]:
        """Pose by a transform (4, 4), and the stretch (4, 4) before it, the same for all rotations of a body."""
        linear, stretch = matrix[:3, :3], np.eye(4)
        _, sizes, axes = np.linalg.svd(linear)
        if sizes[2] > _LEAST_STRETCH * sizes[0]:
            unit = 2.0 ** np.floor(np.log2(sizes[0]))
            stretch[:3, :3] = unit * np.round((axes.T * (sizes / unit)) @ axes, _DIGITS)
        else:
            stretch[:3, :3] = linear
        return cls(linear @ np.linalg.inv(stretch[:3, :3]), matrix[:3, 3].copy()), stretch

    def outwards(self, directions: Array) -> Array:
        """(k, 3): directions of the body in the world."""
        return np.asarray(directions @ self.turn.T)

    def inwards(self, directions: Array) -> Array:
        """(k, 3): directions of the world in the body."""
        return np.asarray(directions @ self.turn)


@dataclass(frozen=True, eq=False)
class Occluders:
    """Occluders of the light on a body.

    Parameters
    ----------
    body : Object
        Itself.
    opaque : OpaqueSurfaces, optional
    """

    body: Object
    opaque: OpaqueSurfaces | None = None

    @cached_property
    def pose(self) -> Pose:
        """Position and rotation of the body."""
        return Pose.of(self.body.matrix)[0]

    def nearest(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Distance in metres at which rays (k, 3), (k, 3) hit the body, and at which anything opaque; inf for none."""
        into = np.linalg.inv(self.body.matrix)
        rays, number = (origins @ into[:3, :3].T + into[:3, 3], directions @ into[:3, :3].T), np.arange(len(origins))
        own = ray_caster_of(self.body.mesh).distances(*rays, number, number).astype(np.float64)
        if self.opaque is None:
            return own, np.full(len(origins), np.inf)
        return own, self.opaque.caster.distances(origins, directions, number, number).astype(np.float64)


def opaque_surfaces(objects: Sequence[Object]) -> OpaqueSurfaces | None:
    """All opaque objects of a scene as one mesh in world coordinates, ready for rays; None if there are none."""
    return OpaqueSurfaces(objects) if any(len(item.mesh.faces) for item in objects) else None


def rays_of_photons(photons: EnteringPhotons, grid: BodyGrid, pose: Pose) -> EnteringRays:
    """Rays in place of photons that enter a body: each counts at the nearest sample and its neighbors."""
    sample = nearest_samples(
        grid.points,
        grid.face_normals,
        grid.area,
        pose.inwards(photons.points - pose.shift),
        -pose.inwards(photons.directions),
    )
    flux = photons.power / grid.areas[sample, None]
    rays = EnteringRays(sample, pose.inwards(photons.directions), flux, np.zeros_like(flux))
    found = two_of_many(rays, grid.face_normals, grid.mean_around)
    # Means keep even light even, and its power nearly.
    power = grid.areas[found.samples] @ found.entering
    scale = photons.power.sum(axis=0) / np.where(power > 0.0, power, 1.0)
    return replace(found, entering=scale * found.entering)


@dataclass(frozen=True, eq=False)
class Sky:
    """Visibility of the sky, and of the body itself, from each sample of its surface in directions above it.

    Attributes
    ----------
    directions : (k, 3) float64
    sample, direction : (n,) int32
        Pairs of a sample and a direction above the surface there.
    cosine : (n,) float32
        With the normal.
    distance : (n,) float32
        In metres to where the body itself is hit; inf where the sky is visible.
    facing, other : (h,) int64
        Pairs in which the body itself is, and the sample nearest to the place.
    """

    directions: Array
    sample: npt.NDArray[np.int32]
    direction: npt.NDArray[np.int32]
    cosine: Floats
    distance: Floats
    facing: Integers
    other: Integers

    @cached_property
    def first(self) -> Integers:
        """(l,): first pair of each sample that has some."""
        return np.flatnonzero(np.diff(self.sample, prepend=-1))


def sky_of(grid: BodyGrid) -> Sky:
    """Trace rays from each sample of a surface for the directions in which it sees the sky."""
    directions, body = even_directions(DIRECTIONS), grid.body
    cosine = (grid.normals @ directions.T).astype(np.float32)
    above = (cosine > 0.0) & (grid.face_normals @ directions.T > 0.0)
    flat = np.flatnonzero(above)
    sample, direction = (part.astype(np.int32) for part in np.divmod(flat, len(directions)))
    start, into = grid.points + BEFORE * grid.cells.step * grid.face_normals, np.linalg.inv(body.matrix)
    local = start @ into[:3, :3].T + into[:3, 3]
    distance = ray_caster_of(body.mesh).distances(local, directions @ into[:3, :3].T, sample, direction)
    facing = np.flatnonzero(np.isfinite(distance))
    places = start[sample[facing]] + distance[facing, None] * directions[direction[facing]]
    other = cKDTree(grid.points).query(places)[1] if len(facing) else np.zeros(0, np.int64)
    return Sky(directions, sample, direction, cosine.ravel()[flat], distance, facing, np.asarray(other, np.int64))


def even_directions(count: int) -> Array:
    """(count, 3): unit vectors on a Fibonacci spiral."""
    number = np.arange(count) + 0.5
    up = 1.0 - 2.0 * number / count
    angle, level = np.pi * (1.0 + np.sqrt(5.0)) * number, np.sqrt(1.0 - up * up)
    return np.stack([level * np.cos(angle), level * np.sin(angle), up], axis=1)


def environment_parts(
    environment: Environment, directions: Array, turn: Array | None = None, *, suns: bool = True
) -> Array:
    """(k, 3): radiance of the environment, integrated over the part of the sphere nearest to each direction.

    `turn` (3, 3) rotates the directions to those of the environment. Without `suns`, see `suns_of`, all else.
    """
    if environment.map is None:
        nearest, _ = nearest_parts(directions)
        texels, angle = _map_directions()
        radiance = angle[:, None] * np.asarray(
            environment.lighting(texels if turn is None else texels @ turn.T), np.float64
        )
    else:
        # Of a picture every pixel counts, however small the sun is.
        power, rest = _map_power(environment)
        texels = _turned_texels(environment)
        towards = directions if turn is None else directions @ turn.T
        nearest = np.asarray((texels.astype(np.float32) @ towards.T.astype(np.float32)).argmax(axis=1))
        radiance = power if suns else rest
    return np.stack([np.bincount(nearest, radiance[:, channel], len(directions)) for channel in range(3)], axis=1)


def suns_of(environment: Environment) -> tuple[DirectionalLight, ...]:
    """Directional lights for the parts of an environment brighter than `SUN` times its mean.

    All of them together are smaller than 1 / `SUN` of the sphere. Their light comes from one direction in each of
    `DIRECTIONS` parts of it.
    """
    if environment.map is None:
        return ()
    power, rest = _map_power(environment)
    bright = np.flatnonzero((power != rest).any(axis=1))
    if not len(bright):
        return ()
    texels = _turned_texels(environment)
    part = cKDTree(even_directions(DIRECTIONS)).query(texels[bright])[1]
    found = []
    for number in np.unique(part):
        at = bright[part == number]
        irradiance = power[at] - rest[at]
        found.append(DirectionalLight(-(irradiance.sum(axis=1) @ texels[at]), irradiance.sum(axis=0)))
    return tuple(found)


def radiance_without_suns(environment: Environment, directions: Array) -> Array:
    """(k, 3): radiance from unit vectors (k, 3), up to `SUN` times the mean of the environment."""
    radiance = np.asarray(environment.lighting(directions), np.float64)
    return radiance if environment.map is None else radiance * _below_suns(radiance, environment)


#: Radiance times solid angle (k, 3) of the pixels of environments at a scale of 1, in rows of `MAP_HEIGHT`, and that
#: without suns: they stay when one is turned, or brightened.
_powers: WeakKeyDictionary[EnvironmentMap, tuple[Array, Array]] = WeakKeyDictionary()


def _map_power(environment: Environment) -> tuple[Array, Array]:
    """(k, 3), (k, 3): radiance of an image's texels times their solid angle, and that without suns."""
    assert environment.map is not None
    if (powers := _powers.get(environment.map)) is None:
        height, width = MAP_HEIGHT, 2 * MAP_HEIGHT
        radiance = environment.map.reduced(height, width).reshape(-1, 3)
        power = np.repeat(row_solid_angles(height, width), width)[:, None] * radiance
        powers = _powers[environment.map] = power, power * _below_suns(environment.scale * radiance, environment)
    return environment.scale * powers[0], environment.scale * powers[1]


def _turned_texels(environment: Environment) -> Array:
    """(k, 3): directions of an image's texels in the world, see `_map_power`."""
    height, width = MAP_HEIGHT, 2 * MAP_HEIGHT
    polar = np.pi * (np.arange(height) + 0.5)[:, None] / height
    azimuth = 2.0 * np.pi * ((np.arange(width) + 0.5) / width - environment.turn - 0.5)
    level = np.sin(polar)
    parts = level * np.sin(azimuth), np.cos(polar), -level * np.cos(azimuth)
    return np.stack(np.broadcast_arrays(*parts), axis=-1).reshape(-1, 3)


def _below_suns(radiance: Array, environment: Environment) -> Array:
    """(k, 1): fraction of a radiance (k, 3) that is not above `SUN` times the mean in any channel."""
    mean = np.maximum(environment.mean, np.finfo(np.float32).tiny)
    return np.asarray(np.minimum(1.0, SUN / np.maximum((radiance / mean).max(axis=1, keepdims=True), 1e-30)))


def nearest_parts(directions: Array) -> tuple[Integers, Array]:
    """Index of the direction nearest to each texel of an environment map, and the solid angle around each (k,)."""
    return _nearest_parts(directions.tobytes())


@cache
def _nearest_parts(packed: bytes) -> tuple[Integers, Array]:
    directions = np.frombuffer(packed).reshape(-1, 3)
    texels, angle = _map_directions()
    nearest = np.asarray(cKDTree(directions).query(texels)[1])
    return nearest, np.asarray(np.bincount(nearest, angle, len(directions)), np.float64)


@cache
def _map_directions() -> tuple[Array, Array]:
    """Directions and solid angles of the texels of an equirectangular map."""
    angle = np.repeat(row_solid_angles(MAP_HEIGHT, 2 * MAP_HEIGHT), 2 * MAP_HEIGHT)
    return texel_directions(MAP_HEIGHT, 2 * MAP_HEIGHT).reshape(-1, 3), angle


def transfer(sky: Sky, samples: int, ior: float, interface: DiffuseInterface) -> Array:
    """(n,): flux that enters for a unit of radiance from the part of the sphere around each direction of the pairs."""
    # In parts that stay in the processor's cache.
    parts = np.array_split(sky.cosine, len(sky.cosine) // _TOGETHER + 1)
    reflected = np.concatenate([optics.fresnel_dielectric(part, ior) for part in parts])
    passed = (1.0 - reflected) * sky.cosine * nearest_parts(sky.directions)[1][sky.direction]
    polished = np.bincount(sky.sample, passed, samples)
    exact = np.pi * interface.entering
    correction = np.clip(exact / np.maximum(polished, 1e-9), *_CORRECTION)
    return np.asarray(passed * correction[sky.sample])


def sky_light(
    sky: Sky, received: Floats, means: Array, normals: Array, ior: float, mirrored: float
) -> tuple[Array, EnteringRays]:
    """Light of the environment: uniform flux (s, 3) at the samples, and two rays at each for the rest.

    Of each sample, the least radiance in the directions above it is uniform, and the rays are a quadrature of the rest,
    see `two_directions`.

    Parameters
    ----------
    sky : Sky
        In k directions.
    received : (1 or 3, s, k) float32
        See `Entrance`, in all channels alike or in each.
    means : (k, 3) float64
        Mean radiance of each part.
    normals : (s, 3)
        Of the surface at the samples.
    ior : float
    mirrored : float
        Flux that the surface mirrors, as if it was diffuse, for a unit of what enters.
    """
    least, pairs, directions = means.min(axis=0), list(combinations_with_replacement(range(3), 2)), sky.directions
    # In units of the brightest part, for single precision.
    scale = max(float((means - least).max()), np.finfo(np.float64).tiny)
    means = (means - least) / scale
    above, seen = np.zeros((len(normals), 3)), np.take(means.T.astype(np.float32), sky.direction, axis=1)
    above[sky.sample[sky.first]] = np.minimum.reduceat(seen, sky.first, axis=1).T
    moments = np.column_stack([directions, *(directions[:, i] * directions[:, j] for i, j in pairs)])
    uniform, flux, sums = np.zeros((len(normals), 3)), np.zeros((len(normals), 3)), np.zeros((len(normals), 9))
    for part, of in zip(received, np.split(np.arange(3), len(received)), strict=True):
        total = means[:, of].sum(axis=1, keepdims=True)
        columns = np.column_stack([means[:, of], np.ones(len(means)), total * moments, moments]).astype(np.float32)
        found = (part @ columns).astype(np.float64)
        own, even, light, all_around = np.split(found, np.cumsum([len(of), 1, 9]), axis=1)
        uniform[:, of], flux[:, of] = even * (least + scale * above)[:, of], own - even * above[:, of]
        sums += light - above[:, of].sum(axis=1, keepdims=True) * all_around
    flux = np.maximum(flux, 0.0)
    samples = np.flatnonzero(scale * flux.sum(axis=1) > _ROUNDING * uniform.sum(axis=1))
    own, total = normals[samples], flux[samples].sum(axis=1, keepdims=True)
    first, second = np.split(sums[samples] / total, [3], axis=1)
    products = np.stack([(1 + (i != j)) * own[:, i] * own[:, j] for i, j in pairs], axis=1)
    towards = two_directions(-first, (second * products).sum(axis=1), own)
    refracted = [refracted_direction(each, own, np.full(len(own), ior)) for each in towards]
    half = 0.5 * scale * flux[samples]
    return uniform, joined_rays([EnteringRays(samples, each, half, mirrored * half) for each in refracted])


def from_light(
    grid: BodyGrid,
    casters: Occluders,
    light: Light,
    ior: float,
    interface: DiffuseInterface,
    dimming: Sequence[Object] = (),
    stops: RayCaster | None = None,
) -> EnteringRays:
    """Flux of a light that enters at the samples of a surface, with shadows, dimmed by other bodies.

    `stops` are surfaces of other bodies that none of it passes.
    """
    pose = casters.pose
    points = pose.outwards(grid.points) + pose.shift
    all_normals, face_normals = pose.outwards(grid.normals), pose.outwards(grid.face_normals)
    if isinstance(light, PositionalLight):
        towards = np.asarray(light.position) - points
        distance = np.sqrt(dot(towards, towards))
        direction = towards / np.maximum(distance, 1e-18)[:, None]
        depth, gain = _spread(towards, face_normals, grid.area)
    else:
        direction = np.broadcast_to(-np.asarray(light.direction), points.shape)
        distance = np.full(len(points), np.inf)
        depth, gain = np.zeros(len(points)), np.ones(len(points))
    lit = np.flatnonzero((dot(direction, all_normals) > 0.0) & (dot(direction, face_normals) > 0.0))
    start = points[lit] + BEFORE * grid.cells.step * face_normals[lit]
    nearest = np.minimum(*casters.nearest(start, direction[lit]))
    if stops is not None:
        nearest = np.minimum(nearest, stops.nearest(start, direction[lit])[1])
    free = nearest >= distance[lit]
    lit, start = lit[free], start[free]
    towards, normals = direction[lit], all_normals[lit]
    sunk = depth[lit, None] * face_normals[lit]
    if depth[lit].any():
        towards = distance[lit, None] * towards + sunk
        towards = unit(towards)
    reflected = optics.fresnel_dielectric(np.maximum(dot(towards, normals), 0.0), ior)[:, None]
    # What a rough interface loses, of any light as of uniform light.
    relative = interface.entering / diffuse_interface(ior).entering
    flux = np.asarray(light.irradiance_on(points[lit] - sunk, normals), np.float64) * gain[lit, None]
    if dimming:
        flux = flux * light_passed(dimming, start, towards, distance[lit])
    refracted = pose.inwards(refracted_direction(-towards, normals, np.full(len(lit), ior)))
    return EnteringRays(lit, refracted, (1.0 - reflected) * relative * flux, reflected * flux, from_one=True)


def _spread(towards: Array, face_normals: Array, area: float) -> tuple[Array, Array]:
    """Depth below the surface at which each sample receives a very near light, and the factor of its light, (s,) each.

    A light that is nearer to the surface than its samples are to each other shines on a spot between them. On a plane
    the irradiance h / (r^2 + h^2)^(3/2) of a point light at height h has the same integral 2 pi for every h: as seen
    from samples that lie deeper, the spot is as wide as they are apart, and has the light of the narrow one within
    `_REACH`.
    """
    width = _WIDTH * np.sqrt(area / np.pi)
    if dot(towards, towards).min(initial=np.inf) > (1.0 + _REACH**2) * width**2:
        return np.zeros(len(towards)), np.ones(len(towards))
    height = dot(towards, face_normals)
    across = np.linalg.norm(towards - height[:, None] * face_normals, axis=1)
    near = (height > 0.0) & (height < width) & (across < _REACH * width)
    within = 1.0 - height / np.hypot(height, _REACH * width)
    gain = within / (1.0 - 1.0 / np.hypot(1.0, _REACH))
    return np.where(near, width - height, 0.0), np.where(near, gain, 1.0)
