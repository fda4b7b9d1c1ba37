"""Single scattering towards the eye, to a tolerance (Max 1995, sections 5 and 6).

L = integral over the ray of T(t) sum sigma_s p(cos) E(t) dt, with the transmittance T from the eye to t and the
irradiance E of each light there, attenuated by all bodies on its path and stopped by opaque objects.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers, Mask, expanded
from translucent.formulas import optics
from translucent.geometry.grouping import shared_edges
from translucent.media.medium import MAX_COEFFICIENT
from translucent.reference.compositing import _layers
from translucent.reference.hits import Rays, TracedObject
from translucent.reference.light_paths import LightPaths
from translucent.reference.quadrature import equiangular, integrate
from translucent.reference.volume import Segments, points_on
from translucent.scene.lights import DirectionalLight, PositionalLight, SpotLight
from translucent.scene.scene import Light

#: Number of pairs of an edge and a ray that are tested together: the working arrays stay below 100 MB.
PAIRS = 1 << 18


def outline_edges(traced: TracedObject, light: Light) -> Array:
    """(e, 2, 3): silhouette edges of an object as seen from a light: one face is lit, and the other is not."""
    faces, corners = traced.body.mesh.faces, traced.corners
    with np.errstate(under="ignore"):
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        if isinstance(light, DirectionalLight):
            towards = -np.broadcast_to(np.asarray(light.direction), normals.shape)
        else:
            towards = np.asarray(light.position) - corners[:, 0]
        lit = np.einsum("ki,ki->k", normals, towards) > 0
    edges = shared_edges(faces)
    # Each lit face counts as 1 and each other one as -1: an edge between two faces alike has 2.
    net = np.bincount(edges.of, np.where(np.repeat(lit, 3), 1.0, -1.0))
    chosen = edges.first[np.abs(net) != 2]
    return np.stack([corners.reshape(-1, 3)[chosen], np.roll(corners, -1, axis=1).reshape(-1, 3)[chosen]], axis=1)


def shadow_edges(rays: Rays, edges: Array, light: Light) -> tuple[Integers, Array]:
    """Indices of rays (k,), and distances (k,) at which light that grazes one of the edges (e, 2, 3) crosses them."""
    found = [(np.empty(0, np.int64), np.empty(0))]
    each = max(PAIRS // max(len(edges), 1), 1)
    for begin in range(0, len(rays), each):
        ray, t = _shadow_edges(rays.where(slice(begin, begin + each)), edges, light)
        found.append((ray + begin, t))
    return np.concatenate([ray for ray, _ in found]), np.concatenate([t for _, t in found])


@np.errstate(all="ignore")
def cone_edges(rays: Rays, light: Light) -> tuple[Integers, Array]:
    """Indices of rays (k,), and distances (k,) at which they cross the inner or the outer cone of a spot."""
    if not isinstance(light, SpotLight):
        return np.empty(0, np.int64), np.empty(0)
    axis, from_light = np.asarray(light.direction), rays.origins - np.asarray(light.position)
    along = [vector @ axis for vector in (from_light, rays.directions)]
    across = [vector - s[:, None] * axis for vector, s in zip((from_light, rays.directions), along, strict=True)]
    found = []
    for angle in np.radians((light.inner_cone, light.outer_cone)):
        # On the cone, or on its mirror image behind: (sin * along)^2 = (cos * across)^2. For an angle of 0, where the
        # ray is nearest to the axis: smooth, but all light of narrow cones is about there.
        a, b, c = (
            (np.sin(angle) ** 2 * along[i] * along[j])
            - np.cos(angle) ** 2 * np.einsum("ki,ki->k", across[i], across[j])
            for i, j in ((1, 1), (0, 1), (0, 0))
        )
        root = np.sqrt(np.maximum(b * b - a * c, 0.0) if angle == 0.0 else b * b - a * c)
        for t in ((-b - root) / a, (-b + root) / a):
            front = np.flatnonzero(np.isfinite(t) & (along[0] + t * along[1] >= 0.0))
            found.append((front, t[front]))
    return np.concatenate([ray for ray, _ in found]), np.concatenate([t for _, t in found])


@np.errstate(all="ignore")
def _shadow_edges(rays: Rays, edges: Array, light: Light) -> tuple[Integers, Array]:
    """`shadow_edges` of few rays. Rays towards the light itself have no plane with it, and no edges."""
    if isinstance(light, DirectionalLight):
        light_vector = np.broadcast_to(np.asarray(light.direction), rays.directions.shape)
    else:
        light_vector = np.asarray(light.position) - rays.origins
    # Each edge has at most one point in the plane of a ray and the light.
    normal = np.cross(rays.directions, light_vector)
    above, below = (normal @ (edges[:, i].T) - np.einsum("ki,ki->k", normal, rays.origins)[:, None] for i in (0, 1))
    ray, edge = np.nonzero((above > 0) != (below > 0))
    fraction = above[ray, edge] / (above[ray, edge] - below[ray, edge])
    point = edges[edge, 0] + fraction[:, None] * (edges[edge, 1] - edges[edge, 0]) - rays.origins[ray]
    if isinstance(light, DirectionalLight):
        source, direction = point, light_vector[ray]
    else:
        source, direction = light_vector[ray], point - light_vector[ray]
    across = np.cross(rays.directions[ray], direction)
    t = np.einsum("ki,ki->k", np.cross(source, direction), across) / np.einsum("ki,ki->k", across, across)
    # The light passes the edge first.
    after = np.einsum("ki,ki->k", t[:, None] * rays.directions[ray] - point, direction) > 0
    keep = np.isfinite(t) & after
    return ray[keep], t[keep]


#: Largest number of cuts near the start of segments: a rule of 15 points then resolves the thin visible layer of a
#: dense one.
MOST_CUTS = 60


@dataclass(frozen=True, eq=False)
class Scattered:
    """Singly scattered light towards the origins of rays.

    Attributes
    ----------
    radiance : (n, 3) float64
    error : (n, 3) float64
        Estimated error of the radiance.
    valid : (n,) bool
        The tolerance is met, the ray does not hit a light, and no light came through a hole of a body. Media so deep
        that light does not get as far as float64 resolves are left out, and invalid.
    """

    radiance: Array
    error: Array
    valid: Mask


def scattered_once(paths: LightPaths, rays: Rays, segments: Segments, filling: Array, tolerance: float) -> Scattered:
    """Integrate singly scattered light of all lights of a scene.

    Parameters
    ----------
    paths : LightPaths
    rays : Rays
    segments : Segments
        Of `volume_segments`, and so is `filling`.
    filling : (k, n) float64
    tolerance : float
        Relative to the radiance of each ray.
    """
    rounding = _rounding(paths, rays, segments)
    chosen = np.flatnonzero(
        (segments.t_exit > segments.t_enter)
        & (filling @ paths.volume.scattering > 0).any(axis=1)
        & (rounding <= 2.0 * tolerance)[segments.pixel]
    )
    spans = _joined([_spans(paths, number, rays, segments, chosen) for number in range(len(paths.lights))])
    work = _InScatter(paths, rays, segments, filling, spans)
    span, start, end = _cut(work)
    group = segments.pixel[spans.segment[span]]
    result = integrate(lambda index, u: work(span[index], u), start, end, group, len(rays), tolerance)
    with np.errstate(under="ignore", over="ignore"):
        error = result.error + np.minimum(rounding, 1.0)[:, None] * result.value
    accurate = (error <= 2.0 * tolerance * result.value.max(axis=1, keepdims=True)).all(axis=1)
    return Scattered(result.value, error, accurate & work.sound & (rounding <= 2.0 * tolerance))


@np.errstate(over="ignore", under="ignore")
def _rounding(paths: LightPaths, rays: Rays, segments: Segments) -> Array:
    """(n,): relative error of scattered light by the rounding of distances, in media of very short free paths.

    Of rays that scatter.
    """
    scatters = np.flatnonzero(segments.t_exit > segments.t_enter)
    reach = segments.t_exit[scatters] + paths.tracer.radius
    found = np.zeros(len(rays))
    depth = segments.extinction[scatters].max(axis=1, initial=0.0) * reach * np.finfo(np.float64).eps
    np.maximum.at(found, segments.pixel[scatters], depth)
    return found


@dataclass(frozen=True, eq=False)
class _LightSpans:
    """Parts of segments between shadow edges: flat arrays.

    Attributes
    ----------
    light : (m,) int64
        Index into `LightPaths.lights`.
    segment : (m,) int64
    start, end : (m,) float64
        Distances along the ray in metres.
    """

    light: Integers
    segment: Integers
    start: Array
    end: Array


class _InScatter:
    """Integrand of each span, in the variable of its light, 0 to 1."""

    def __init__(self, paths: LightPaths, rays: Rays, segments: Segments, filling: Array, spans: _LightSpans) -> None:
        self.paths, self.rays, self.segments, self.filling, self.spans = paths, rays, segments, filling, spans
        self.before = depths_before(segments, len(rays))
        self.sound = np.ones(len(rays), dtype=bool)

    def __call__(self, span: Integers, u: Array) -> Array:
        values = np.zeros((*u.shape, 3))
        for number, light in enumerate(self.paths.lights):
            chosen = np.flatnonzero(self.spans.light[span] == number)
            if chosen.size:
                values[chosen] = self._of_light(light, span[chosen], u[chosen])
        return values

    def _of_light(self, light: Light, span: Integers, u: Array) -> Array:
        segment = self.spans.segment[span]
        ends = self.spans.start[span], self.spans.end[span]
        t, stretch = light_variable(light, self.rays, self.segments.pixel[segment], *ends, u)
        owner, distance = np.repeat(segment, u.shape[1]), t.ravel()
        pixel = self.segments.pixel[owner]
        points = points_on(self.rays, pixel, distance)
        weights = self.paths.volume.at(self.filling[owner], points)
        source, sound = light_source(self.paths, light, weights, points, self.rays.directions[pixel])
        self.sound[pixel[~sound]] = False
        with np.errstate(under="ignore"):
            values = self.transmittance(owner, distance) * source
            return np.asarray(values.reshape(*u.shape, 3) * stretch[..., None])

    def transmittance(self, segment: Integers, distance: Array) -> Array:
        """(k, 3): from the eye to distances (k,) in segments (k,); exact."""
        pixel, enter = self.segments.pixel[segment], self.segments.t_enter[segment]
        volume = self.paths.volume
        ends = (points_on(self.rays, pixel, t) for t in (enter, distance))
        with np.errstate(under="ignore", over="ignore"):
            extinction = volume.between(self.filling[segment], *ends) @ volume.extinction
            return optics.transmittance(self.before[segment] + extinction * (distance - enter)[:, None])


def light_source(
    paths: LightPaths, light: Light, weights: Array, points: Array, directions: Array
) -> tuple[Array, Mask]:
    """Source term sigma_s p(cos) E of one light: radiance per metre (k, 3) that it adds to rays; and where it is sound.

    Parameters
    ----------
    paths : LightPaths
    light : PointLight, SpotLight or DirectionalLight
        One of `LightPaths.lights`.
    weights : (k, n) float64
        What fills the points, as `Volume.at` gives it.
    points, directions : (k, 3) float64
        In metres from the eye, and of the rays that run from the eye.
    """
    arrival = paths.arrival(light, points)
    # The ray runs from the eye, and light to it.
    cosine = -np.einsum("ki,ki->k", arrival.travel, directions)
    with np.errstate(under="ignore", over="ignore"):
        source = paths.volume.source(weights, cosine) * arrival.irradiance
    # Finite, so that nothing of it is left behind what is opaque.
    return np.minimum(source, MAX_COEFFICIENT), arrival.sound


def light_variable(
    light: Light | None, rays: Rays, ray: Integers, start: Array, end: Array, u: Array
) -> tuple[Array, Array]:
    """Distances t (k, p) on rays (k,) between `start` and `end` (k,), at positions u (k, p), 0 to 1, and dt/du.

    For a point light equal steps of u are equal angles as seen from it, else equal lengths.
    """
    if not isinstance(light, PositionalLight):
        length = (end - start)[:, None]
        return start[:, None] + u * length, np.broadcast_to(length, u.shape)
    to_light, direction = np.asarray(light.position) - rays.origins[ray], rays.directions[ray]
    middle = np.einsum("ki,ki->k", to_light, direction)
    return equiangular(start, end, middle, np.linalg.norm(to_light - middle[:, None] * direction, axis=1), u)


@np.errstate(over="ignore")
def depths_before(segments: Segments, pixels: int) -> Array:
    """(k, 3): optical depth of each ray at the start of each of its segments."""
    before, depth = np.zeros((len(segments.pixel), 3)), np.zeros((pixels, 3))
    for layer in _layers(segments.pixel):
        pixel = segments.pixel[layer]
        before[layer] = depth[pixel]
        depth[pixel] += segments.extinction[layer] * segments.length[layer, None]
    return before


def _spans(paths: LightPaths, number: int, rays: Rays, segments: Segments, chosen: Integers) -> _LightSpans:
    """Spans of some segments, cut at the edges of shadows and cones."""
    pixels = np.unique(segments.pixel[chosen])
    light = paths.lights[number]
    edges = np.concatenate([outline_edges(traced, light) for traced in paths.tracer.objects])
    cuts = shadow_edges(rays.where(pixels), edges, light), cone_edges(rays.where(pixels), light)
    ray, t = (np.concatenate(parts) for parts in zip(*cuts, strict=True))
    # In the order along each ray, a cut belongs to the segment that began last, if it has not ended.
    pixel = np.concatenate([segments.pixel[chosen], pixels[ray]])
    t = np.concatenate([segments.t_enter[chosen], t])
    begins = np.arange(len(pixel)) < len(chosen)
    order = np.lexsort((~begins, t, pixel))
    last = np.cumsum(begins[order]) - 1
    pixel, t = pixel[order], t[order]
    owner = chosen[np.maximum(last, 0)]
    inside = (last >= 0) & (segments.pixel[owner] == pixel) & (t < segments.t_exit[owner])
    owner, start = owner[inside], t[inside]
    end = np.where(np.append(owner[1:] == owner[:-1], False), np.append(start[1:], 0.0), segments.t_exit[owner])
    some = end > start
    return _LightSpans(np.full(int(some.sum()), number), owner[some], start[some], end[some])


def _joined(parts: list[_LightSpans]) -> _LightSpans:
    return _LightSpans(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in _LightSpans.__match_args__)
    )


def _cut(work: _InScatter) -> tuple[Integers, Array, Array]:
    """Cut spans into parts, each twice as large as the one before.

    The first is at most one deep, or as short as float64 allows.
    """
    spans, segments = work.spans, work.segments
    reach = spans.end - spans.start
    for number, light in enumerate(work.paths.lights):
        own = np.flatnonzero(spans.light == number)
        ends = spans.start[own], spans.end[own]
        at_start = np.zeros((len(own), 1))
        _, stretch = light_variable(light, work.rays, segments.pixel[spans.segment[own]], *ends, at_start)
        reach[own] = np.maximum(reach[own], stretch[:, 0])
    with np.errstate(over="ignore"):
        depth = segments.extinction[spans.segment].max(axis=1, initial=0.0) * reach
    cuts = np.ceil(np.log2(np.clip(depth, 1.0, 2.0**MOST_CUTS))).astype(np.int64)
    owner, number_in_span = expanded(np.zeros_like(cuts), cuts + 1)
    last = np.exp2(number_in_span - cuts[owner])
    return owner, np.where(number_in_span == 0, 0.0, 0.5 * last), last
