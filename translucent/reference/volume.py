"""Media at each point of a scene, segments of rays with one mixture of media each, and phase functions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array, Integers
from translucent.formulas.phase import ISOTROPIC, Draine, HenyeyGreenstein, PhaseFunction, WaterDroplets
from translucent.geometry.ray_caster import point_from
from translucent.reference.hits import Rays
from translucent.reference.intervals import Intervals
from translucent.reference.surfaces import Crossings
from translucent.scene.scene import Scene


class Volume:
    """The media of a scene as tables, one row for each of `Scene.objects`; 0 for opaque ones.

    Points are in metres from the eye of its camera, along the axes of the world. What fills a point is a row of
    weights, one for each object: how much of its medium is there.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    extinction, scattering, emission : (n, 3) float64
        Where the density is 1. Emission counts what is scattered of the ambient radiance.
    phases : tuple of PhaseFunction
        Those of the media, each once.
    phase : (n,) int64
        Number of that of each object.
    """

    def __init__(self, scene: Scene) -> None:
        media = [body.medium for body in scene.objects]
        self.extinction, self.scattering = (
            np.array([getattr(medium, name) if medium else np.zeros(3) for medium in media], dtype=np.float64)
            for name in ("extinction", "scattering")
        )
        self.emission = np.stack([scene.source(body) for body in scene.objects])
        own = [medium.phase_function if medium else ISOTROPIC for medium in media]
        self.phases = tuple(dict.fromkeys(own))
        self.phase = np.array([self.phases.index(one) for one in own], dtype=np.int64)
        self._densities = [(i, body.density) for i, body in enumerate(scene.objects) if body.density is not None]
        self._boxes = {i: _UnitBox(scene, i) for i, _ in self._densities}

    @property
    def varied(self) -> Integers:
        """Objects in which a density varies."""
        return np.array([i for i, _ in self._densities], dtype=np.int64)

    @property
    def scatters(self) -> bool:
        """True if any medium scatters."""
        return bool((self.scattering > 0).any())

    def at(self, filling: Array, points: Array) -> Array:
        """(k, n): weights of media at points (k, 3) by their densities; `filling` (k, n) are those at density 1."""
        weights = filling.copy() if self._densities else filling
        for i, density in self._densities:
            inside = np.flatnonzero(filling[:, i])
            weights[inside, i] *= density.at(self._boxes[i].positions(points[inside]))
        return weights

    def between(self, filling: Array, start: Array, end: Array) -> Array:
        """(k, n): mean weights on straight lines between points (k, 3), exact; `filling` as for `at`."""
        weights = filling.copy() if self._densities else filling
        for i, density in self._densities:
            inside = np.flatnonzero(filling[:, i])
            positions = (self._boxes[i].positions(points[inside]) for points in (start, end))
            weights[inside, i] *= density.mean_between(*positions)
        return weights

    def majorant(self, filling: Array, table: Array) -> Array:
        """(k, ...): upper bound of a coefficient, `table` (n, ...) by medium, where media fill `filling` (k, n)."""
        largest = np.ones(filling.shape[1])
        for i, density in self._densities:
            largest[i] = density.maximum
        return np.asarray((filling * largest) @ table)

    def source(self, weights: Array, cosine: Array) -> Array:
        """Sum of sigma_s p of all media at a point, (k, 3) in 1/(m sr); each scatters by its own phase function.

        Parameters
        ----------
        weights : (k, n) float64
            As `at` gives them.
        cosine : (k,) float64
            Between the directions of travel before and after the event.
        """
        total = np.zeros((len(weights), 3))
        scattering = np.flatnonzero((self.scattering > 0).any(axis=1))
        for number, phase in enumerate(self.phases):
            if len(alike := scattering[self.phase[scattering] == number]):
                total += weights[:, alike] @ self.scattering[alike] * phase_value(phase, cosine)[:, None]
        return total


class _UnitBox:
    """Unit box of an object: coordinates 0 to 1 along each of its axes."""

    def __init__(self, scene: Scene, index: int) -> None:
        body = scene.objects[index]
        low, high = body.mesh.bounds
        extent = high - low
        inverse = np.linalg.inv(body.matrix[:3, :3])
        # All of a flat mesh is in the middle of its box.
        self._linear = np.where(extent > 0, 1.0 / np.where(extent > 0, extent, 1.0), 0.0)[:, None] * inverse
        self._center = point_from(body.mesh.center, body.matrix, scene.camera.eye)

    def positions(self, points: Array) -> Array:
        """(k, 3): coordinates of points (k, 3) in the box."""
        return np.asarray(0.5 + (points - self._center) @ self._linear.T)


def points_on(rays: Rays, chosen: Integers, distance: Array) -> Array:
    """(k, 3): points at distances (k,) on the `chosen` rays (k,), in metres from the eye."""
    with np.errstate(under="ignore"):
        return np.asarray(rays.origins[chosen] + distance[:, None] * rays.directions[chosen])


@dataclass(frozen=True, eq=False)
class Segments:
    """Segments of rays between neighboring surfaces: flat arrays, in order along each ray, without overlap.

    Attributes
    ----------
    pixel : (k,) int64
        Number of the ray; ascending.
    t_enter, t_exit : (k,) float64
        Distances in metres from the ray's origin; equal for a sheet.
    length : (k,) float64
        Metres of the media: t_exit - t_enter, or the path through a sheet.
    extinction : (k, 3) float64
        Of all media there, in 1/m.
    emission : (k, 3) float64
        Of all media there, in radiance per metre.
    count : (k,) int64
        How often thickness counts the length.
    """

    pixel: Integers
    t_enter: Array
    t_exit: Array
    length: Array
    extinction: Array
    emission: Array
    count: Integers


def volume_segments(
    scene: Scene, volume: Volume, rays: Rays, intervals: Intervals, crossings: Crossings
) -> tuple[Segments, Array]:
    """Ordered segments of the media on each ray, and the weights of media in each where the density is 1.

    Segments get the mean extinction and emission between their ends, so that their optical depth is exact. So is what
    they emit where it varies as the extinction does, that is in one medium; for mixtures see `emission_of_mixtures`.

    Parameters
    ----------
    scene : Scene
        `Scene.overlap` decides what fills a point in several bodies. A sheet adds to what it stands in.
    volume : Volume
        Of the scene.
    rays : Rays
    intervals : Intervals
        Of solids; bodies are indices into `Scene.objects`.
    crossings : Crossings
        Of sheets; each cuts the piece in which it stands.

    Returns
    -------
    segments : Segments
    filling : (k, n) float64
        `Volume` explains it.
    """
    pixel, t_enter, t_exit, bodies, windings = _pieces(intervals, crossings)
    solid, sheet = np.zeros((len(pixel), len(scene.objects))), np.zeros((len(crossings.body), len(scene.objects)))
    solid[:, bodies] = multiplicities(scene, bodies, windings).T
    sheet[np.arange(len(sheet)), crossings.body] = 1.0
    inside = np.maximum(windings, 0) if scene.overlap == "add" else (windings > 0).any(axis=0, keepdims=True)
    at = crossings.distance
    columns = [
        np.concatenate(pair)
        for pair in (
            (pixel, crossings.pixel),
            (t_enter, at),
            (t_exit, at),
            (t_exit - t_enter, crossings.path),
            (inside.sum(axis=0, dtype=np.int64), np.ones(len(sheet), dtype=np.int64)),
            (solid, sheet),
        )
    ]
    # Of two pieces that begin at one point, the sheet goes first: it ends there, too.
    order = np.lexsort((columns[2], columns[1], columns[0]))
    pixel, t_enter, t_exit, length, count, filling = (column[order] for column in columns)
    weights = volume.between(filling, *(points_on(rays, pixel, t) for t in (t_enter, t_exit)))
    extinction, emission = weights @ volume.extinction, weights @ volume.emission
    if (crossings.covered > 0).any():
        row = np.flatnonzero(order >= len(solid))
        source = order[row] - len(solid)
        covered = (crossings.covered[source] / crossings.path[source])[:, None]
        extinction[row] += covered
        emission[row] += covered * crossings.radiance[source]
    return Segments(pixel, t_enter, t_exit, length, extinction, emission, count), filling


def _pieces(
    intervals: Intervals, crossings: Crossings
) -> tuple[Integers, Array, Array, Integers, npt.NDArray[np.int32]]:
    """Pixel, t_enter and t_exit (k,) of the pieces in any body; the bodies (b,), and their windings there (b, k)."""
    bodies, row = np.unique(intervals.body, return_inverse=True)
    pixel = np.concatenate([intervals.pixel, intervals.pixel, crossings.pixel])
    t = np.concatenate([intervals.t_enter, intervals.t_exit, crossings.distance])
    order = np.lexsort((t, pixel))
    pixel, t = pixel[order], t[order]
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    enters, exits = rank[: len(row)], rank[len(row) : 2 * len(row)]
    windings = np.zeros((len(bodies), len(order)), dtype=np.int32)
    windings[row, enters], windings[row, exits] = intervals.winding, -intervals.winding
    # Each interval ends on its ray, so the sums are back to 0 where the next ray begins.
    windings = np.cumsum(windings, axis=1, dtype=np.int32)
    keep = np.flatnonzero((windings[:, :-1] != 0).any(axis=0) & (t[1:] > t[:-1]))
    return pixel[keep], t[keep], t[keep + 1], bodies, windings[:, keep]


def multiplicities(scene: Scene, bodies: Integers, windings: npt.NDArray[np.int32]) -> Array:
    """(b, k): multiplicity of each body's medium at each point, by the overlap policy of the scene."""
    inside = windings > 0
    if scene.overlap == "add" or not len(bodies):
        return np.maximum(windings, 0).astype(np.float64)
    weights = np.zeros(windings.shape)
    filled = np.flatnonzero(inside.any(axis=0))
    if scene.overlap == "priority":
        order = np.argsort([-scene.objects[i].priority for i in bodies], kind="stable")
        weights[order[inside[order].argmax(axis=0)][filled], filled] = 1.0
        return weights
    keys = [_medium_key(scene, i) for i in bodies]
    for key in dict.fromkeys(keys):
        alike = np.array([row for row, other in enumerate(keys) if other == key])
        present = np.flatnonzero(inside[alike].any(axis=0))
        weights[alike[inside[alike].argmax(axis=0)][present], present] = 1.0
    return weights


def _medium_key(scene: Scene, index: int) -> tuple[object, ...]:
    """Key of a medium, equal for bodies of one medium, which fill common points once; a density makes it unique."""
    body = scene.objects[index]
    medium = body.medium
    if medium is None or body.density is not None:
        return (int(index),)
    values = (medium.extinction, medium.scattering, medium.emission)
    return (*(tuple(np.asarray(v).tolist()) for v in values), medium.phase_function if medium.scatters else ISOTROPIC)


def phase_value(phase: PhaseFunction, cosine: Array) -> Array:
    """Phase function in 1/sr at cosines between the directions of travel before and after the event."""
    match phase:
        case HenyeyGreenstein(g):
            return _henyey_greenstein(cosine, g)
        case Draine(g, alpha):
            # Its norm: half the integral of cos^2 times Henyey and Greenstein's is (1 + 2 g^2) / 3.
            return _henyey_greenstein(cosine, g) * (1 + alpha * cosine**2) / (1 + alpha * (1 + 2 * g**2) / 3)
        case WaterDroplets(diameter):
            parts, weight = _droplets(diameter)
            return (1 - weight) * phase_value(parts[0], cosine) + weight * phase_value(parts[1], cosine)
    raise NotImplementedError(f"the reference has no {phase.name}")


def scattered_directions(
    directions: Array, phases: Sequence[PhaseFunction], chosen: Integers, rng: np.random.Generator
) -> Array:
    """Unit vectors (k, 3) distributed by phase functions around `directions` (k, 3).

    Parameters
    ----------
    directions : (k, 3) float64
        Of travel before the event; unit vectors.
    phases : sequence of PhaseFunction
    chosen : (k,) int
        Number of that of each event.
    rng : numpy.random.Generator
    """
    u = rng.random(len(directions))
    cosine = np.empty(len(directions))
    angle = 2.0 * np.pi * rng.random(len(directions))
    for number, phase in enumerate(phases):
        own = chosen == number
        cosine[own] = _cosines(phase, u[own], rng)
    return turned(directions, cosine, angle)


def turned(directions: Array, cosine: Array, angle: Array) -> Array:
    """Unit vectors (k, 3) at the cosines (k,) to unit vectors (k, 3), at angles (k,) around them."""
    sine = np.sqrt(np.maximum((1.0 - cosine) * (1.0 + cosine), 0.0))
    across, up = _frame(directions)
    with np.errstate(under="ignore"):
        aside = across * np.cos(angle)[:, None] + up * np.sin(angle)[:, None]
        found = directions * cosine[:, None] + aside * sine[:, None]
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def _cosines(phase: PhaseFunction, u: Array, rng: np.random.Generator) -> Array:
    """Cosines distributed by a phase function, for numbers `u` (k,) evenly distributed over 0 to 1, and others."""
    match phase:
        case HenyeyGreenstein(g):
            return henyey_greenstein_cosine(u, g)
        case Draine(g, alpha):
            # By rejection: Henyey and Greenstein's, each kept by the chance (1 + alpha cos^2) / (1 + alpha).
            cosine = henyey_greenstein_cosine(u, g)
            left = np.arange(len(u))
            while len(left := left[rng.random(len(left)) * (1 + alpha) > 1 + alpha * cosine[left] ** 2]):
                cosine[left] = henyey_greenstein_cosine(rng.random(len(left)), g)
            return cosine
        case WaterDroplets(diameter):
            parts, weight = _droplets(diameter)
            second = rng.random(len(u)) < weight
            return np.where(second, _cosines(parts[1], u, rng), _cosines(parts[0], u, rng))
    raise NotImplementedError(f"the reference has no {phase.name}")


def _henyey_greenstein(cosine: Array, g: float) -> Array:
    """Henyey and Greenstein 1941: (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2))."""
    ahead = 1.0 - cosine if g >= 0 else 1.0 + cosine
    base = (1.0 - abs(g)) ** 2 + 2.0 * abs(g) * ahead
    return np.asarray((1.0 - g) * (1.0 + g) / (4.0 * np.pi * base * np.sqrt(base)))


def _droplets(diameter: float) -> tuple[tuple[HenyeyGreenstein, Draine], float]:
    """The two parts of light that water droplets scatter, and the fraction of the second: Jendersie and d'Eon 2023."""
    um = diameter / 1e-6
    g_hg, g_d = np.exp(-0.0990567 / (um - 1.67154)), np.exp(-2.20679 / (um + 3.91029) - 0.428934)
    alpha, w_d = np.exp(3.62489 - 8.29288 / (um + 5.52825)), np.exp(-0.599085 / (um - 0.641583) - 0.665888)
    return (HenyeyGreenstein(float(g_hg)), Draine(float(g_d), float(alpha))), float(w_d)


def henyey_greenstein_cosine(u: npt.ArrayLike, g: float) -> Array:
    """Cosine between the directions before and after the event, from `u` in 0 to 1 (Witt 1977).

    Rearranged so that nothing is divided by g, which may be 0.
    """
    a = 2.0 * np.asarray(u, dtype=np.float64) - 1.0
    with np.errstate(under="ignore"):
        root = (1.0 - g) * (1.0 + g) / (1.0 + g * a)
        return np.clip(0.5 * ((a + g) * (1.0 + root) / (1.0 + g * a) + g), -1.0, 1.0)


@np.errstate(under="ignore")
def _frame(directions: Array) -> tuple[Array, Array]:
    """Two unit vectors (k, 3) each, at right angles to each other and to `directions` (Duff et al. 2017)."""
    x, y, z = directions.T
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (
        np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1),
        np.stack([b, sign + y * y * a, -y], axis=-1),
    )
