"""Solids with their truth: volume, path length along any ray in closed form, and how far their meshes are off.

Each solid is closed, so a ray within one of its flat faces counts as inside.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import cos, pi, prod

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.geometry import solids
from translucent.geometry.mesh import Mesh
from translucent.geometry.solids import require_measures, revolve, unit_sphere


def dot(a: Array, b: Array) -> Array:
    """Scalar product over the last axis."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def nearest_to_zero(point: Array, direction: Array) -> tuple[Array, Array]:
    """Point of each line nearest to 0, and its distance along the line.

    From there a quadric's terms have the size of the solid, however far away the ray began. The second round removes
    what the first, with its large numbers, has left along the line.
    """
    square = dot(direction, direction)
    shift = np.zeros_like(square)
    for _ in range(2):
        step = -dot(point, direction) / square
        point, shift = point + step[..., None] * direction, shift + step
    return point, shift


def between(position: Array, velocity: Array, half: Array) -> tuple[Array, Array]:
    """Range of t with `position + t velocity` within [-half, half]: first and last t; empty if start > end."""
    moving = velocity != 0
    safe = np.where(moving, velocity, 1.0)
    always = np.where(np.abs(position) <= half, np.inf, -np.inf)
    one, other = (-half - position) / safe, (half - position) / safe
    return np.where(moving, np.minimum(one, other), -always), np.where(moving, np.maximum(one, other), always)


def quadric(a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Roots of a t^2 + 2 b t + c in ascending order, without cancellation; +-inf where there are fewer.

    The polynomial is negative between them for a >= 0, else outside of them. No solution: (inf, -inf) for a >= 0.
    """
    discriminant = b**2 - a * c
    q = -(b + np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), b))
    one = np.divide(q, a, out=np.copysign(np.inf, q), where=a != 0)
    other = np.divide(c, q, out=np.zeros_like(q), where=q != 0)
    first, second = np.minimum(one, other), np.maximum(one, other)
    constant = (a == 0) & (b == 0)
    nowhere = np.where(constant, c > 0, (a >= 0) & (discriminant < 0))
    first, second = np.where(constant, -np.inf, first), np.where(constant, np.inf, second)
    return np.where(nowhere, np.inf, first), np.where(nowhere, -np.inf, second)


class Solid(ABC):
    """Solid whose surface and whose path length along any ray are known in closed form."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """Exact volume in cubic metres."""

    @abstractmethod
    def tessellate(self, segments: int = 64) -> Mesh:
        """Closed mesh, wound outwards, with its vertices on the surface.

        Parameters
        ----------
        segments : int
            Edges once around; the error of the mesh falls with their square.
        """

    @abstractmethod
    def sagitta(self, segments: int = 64) -> float:
        """Upper bound in metres on the distance between the surface and `tessellate(segments)`, either way."""

    def chord(self, origins: npt.ArrayLike, directions: npt.ArrayLike) -> Array:
        """Path length inside the solid along rays, each from its origin forwards.

        Parameters
        ----------
        origins, directions : array_like (..., 3)
            In metres, and of unit length; they broadcast. An origin may be far away or inside.

        Returns
        -------
        (...,) float64
            Metres.

        Raises
        ------
        InputError
            If a direction is not of unit length.
        """
        origin, direction = np.asarray(origins, dtype=np.float64), np.asarray(directions, dtype=np.float64)
        with np.errstate(over="ignore", under="ignore"):
            if not (np.abs(dot(direction, direction) - 1.0) < 1e-6).all():
                raise InputError("chord along rays", "directions that are not of unit length", "normalize them")
            origin, direction = np.broadcast_arrays(origin, direction)
            length = self._length(origin.reshape(-1, 3), direction.reshape(-1, 3))
            return length.reshape(origin.shape[:-1])

    @abstractmethod
    def _length(self, origins: Array, directions: Array) -> Array:
        """`chord` of checked arrays (n, 3)."""


class _Intervals(Solid):
    """Base class of solids that compute the pieces of a line inside them."""

    def _length(self, origins: Array, directions: Array) -> Array:
        nearest, shift = nearest_to_zero(origins - self._middle(), directions)
        ends = np.maximum(self._inside(nearest, directions), -shift[:, None, None])
        return np.asarray(np.maximum(ends[..., 1] - ends[..., 0], 0.0).sum(axis=-1))

    def _middle(self) -> Array:
        """(3,): center of the solid."""
        return np.zeros(3)

    @abstractmethod
    def _inside(self, point: Array, direction: Array) -> Array:
        """(n, k, 2): entry and exit of each line, as distances from `point`; start >= end says empty.

        `point` (n, 3) is relative to the middle, and the line's nearest to it.
        """


class _Round(_Intervals):
    """Base class of ellipsoids."""

    @abstractmethod
    def shape(self) -> tuple[solids.Vector, solids.Vector]:
        """Center and radii."""

    @property
    def volume(self) -> float:
        """Exact volume in cubic metres."""
        return 4.0 / 3.0 * pi * prod(self.shape()[1])

    def sagitta(self, segments: int = 64) -> float:
        """Upper bound in metres on the distance between the surface and the mesh.

        The depth of the lowest face plane in the unit sphere; no axis stretches it by more than the largest radius.
        """
        unit = unit_sphere(segments)
        a, b, c = unit.vertices[unit.faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        depth = 1.0 - float((dot(normals, a) / np.linalg.norm(normals, axis=1)).min())
        return max(self.shape()[1]) * depth

    def _middle(self) -> Array:
        return np.array(self.shape()[0])

    def _inside(self, point: Array, direction: Array) -> Array:
        radii = np.array(self.shape()[1])
        scaled = direction / radii
        nearest, shift = nearest_to_zero(point / radii, scaled)
        distance, speed = np.linalg.norm(nearest, axis=-1), np.linalg.norm(scaled, axis=-1)
        half = np.sqrt(np.maximum((1.0 - distance) * (1.0 + distance), 0.0)) / speed
        return np.stack([shift - half, shift + half], axis=-1)[..., None, :]


@dataclass(frozen=True)
class Sphere(solids.Sphere, _Round):
    """Sphere of all points within `radius` metres of `center`."""


@dataclass(frozen=True)
class Ellipsoid(solids.Ellipsoid, _Round):
    """Axis-aligned ellipsoid, with `radii` in metres."""


@dataclass(frozen=True)
class Box(solids.Box, _Intervals):
    """Axis-aligned box between the corners `low` and `high`, in metres."""

    @property
    def volume(self) -> float:
        """Exact volume in cubic metres."""
        return prod(b - a for a, b in zip(self.low, self.high, strict=True))

    def sagitta(self, segments: int = 1) -> float:
        """Zero: flat faces are exact."""
        return 0.0

    def _middle(self) -> Array:
        return 0.5 * np.array(self.low) + 0.5 * np.array(self.high)

    def _inside(self, point: Array, direction: Array) -> Array:
        half = 0.5 * (np.array(self.high) - np.array(self.low))
        start, end = between(point, direction, half)
        return np.stack([start.max(axis=-1), end.min(axis=-1)], axis=-1)[..., None, :]


@dataclass(frozen=True)
class Torus(solids.Torus, _Intervals):
    """Torus around z through the origin: a tube of radius `minor` about a circle of radius `major`, in metres."""

    @property
    def volume(self) -> float:
        """Exact volume in cubic metres."""
        return 2.0 * pi**2 * self.major * self.minor**2

    def sagitta(self, segments: int = 64) -> float:
        """Upper bound in metres on the distance between the surface and the mesh.

        Linear interpolation over a triangle with steps h, k errs by (M_uu h^2 + 2 M_uv h k + M_vv k^2) / 8 at most,
        with M the largest second derivatives: major + minor, minor and minor.
        """
        h, k = 2.0 * pi / segments, 2.0 * pi / (segments // 2)
        return ((self.major + self.minor) * h**2 + self.minor * (2.0 * h * k + k**2)) / 8.0

    def _inside(self, point: Array, direction: Array) -> Array:
        """Pieces of each line inside the torus, between roots of its quartic, which are bracketed by its extrema.

        The roots themselves are found in the surface's own equation, whose rounding is far below that of the quartic's
        coefficients. A double root that rounding hides costs less than sqrt(epsilon): a tangent has no more digits.
        """
        # t^4 + c2 t^2 + c1 t + c0, without a cubic term because `point` is the nearest to the center.
        across = dot(direction[:, :2], direction[:, :2])
        c2 = 2.0 * (dot(point, point) + self.major**2 - self.minor**2) - 4.0 * self.major**2 * across
        c1 = -8.0 * self.major**2 * dot(point[:, :2], direction[:, :2])
        companion = np.zeros((len(point), 3, 3))
        companion[:, 1, 0] = companion[:, 2, 1] = 1.0
        companion[:, 0, 2], companion[:, 1, 2] = -c1 / 4.0, -c2 / 2.0
        reach = 2.0 * (self.major + self.minor)
        cuts = np.full((len(point), 5), reach)
        cuts[:, 0] = -reach
        # The real part of a complex pair is no turning point, and an extra cut does no harm.
        cuts[:, 1:4] = np.clip(np.sort(np.linalg.eigvals(companion).real, axis=-1), -reach, reach)
        within = self._implicit(point[:, None], direction[:, None], cuts)[0] < 0
        pieces = np.stack([cuts[:, :-1], cuts[:, 1:]], axis=-1)
        ray, piece = np.nonzero(within[:, :-1] != within[:, 1:])
        leaves = within[ray, piece]
        pieces[ray, piece, leaves.astype(int)] = self._root(point[ray], direction[ray], pieces[ray, piece], leaves)
        pieces[~(within[:, :-1] | within[:, 1:])] = 0.0
        return pieces

    def _implicit(self, point: Array, direction: Array, t: Array) -> tuple[Array, Array]:
        """Squared distance to the circle minus minor^2 at `point + t direction`, and its derivative by `t`."""
        x, y, z = np.moveaxis(point + t[..., None] * direction, -1, 0)
        rho = np.hypot(x, y)
        outwards = np.divide(x * direction[..., 0] + y * direction[..., 1], rho, out=np.zeros_like(rho), where=rho > 0)
        value = (rho - self.major) ** 2 + (z - self.minor) * (z + self.minor)
        return np.asarray(value), np.asarray(2.0 * ((rho - self.major) * outwards + z * direction[..., 2]))

    def _root(self, point: Array, direction: Array, bracket: Array, leaves: npt.NDArray[np.bool_]) -> Array:
        """The root between each pair of ends: Newton's steps while they halve within the bracket, else bisection."""
        low, high = bracket.T.copy()
        t: Array = 0.5 * (low + high)
        last = high - low
        tolerance = 4.0 * np.finfo(np.float64).eps * (self.major + self.minor)
        for _ in range(120):
            value, slope = self._implicit(point, direction, t)
            before = (value < 0) == leaves
            low, high = np.where(before, t, low), np.where(before, high, t)
            step = np.divide(value, slope, out=np.full_like(t, np.inf), where=slope != 0)
            good = (t - step >= low) & (t - step <= high) & (2.0 * np.abs(step) <= last)
            moved = np.where(good, t - step, 0.5 * (low + high))
            # A root once found stays: rounding alone must not throw it back to bisection.
            moved = np.where(last <= tolerance, t, moved)
            last, t = np.abs(moved - t), moved
            if (last <= tolerance).all():
                break
        return t


@dataclass(frozen=True)
class Frustum(_Intervals):
    """Capped cone around z, from -height/2 to height/2; a cylinder, or a cone where one radius is 0. In metres."""

    bottom_radius: float = 1.0
    top_radius: float = 0.0
    height: float = 1.0

    def __post_init__(self) -> None:
        radii = self.bottom_radius, self.top_radius
        require_measures(self, min(radii) >= 0 and max(radii) > 0 and self.height > 0, *radii, self.height)

    @property
    def volume(self) -> float:
        """Exact volume in cubic metres."""
        a, b = self.bottom_radius, self.top_radius
        return pi / 3.0 * self.height * (a**2 + a * b + b**2)

    def tessellate(self, segments: int = 64) -> Mesh:
        """Closed mesh of `segments` sides."""
        profile = [(self.bottom_radius, -self.height / 2), (self.top_radius, self.height / 2)]
        if self.bottom_radius > 0:
            profile.insert(0, (0.0, -self.height / 2))
        if self.top_radius > 0:
            profile.append((0.0, self.height / 2))
        return Mesh(*revolve(np.array(profile), segments), name="frustum")

    def sagitta(self, segments: int = 64) -> float:
        """Upper bound in metres on the distance between the surface and the mesh: that of the largest polygon."""
        return max(self.bottom_radius, self.top_radius) * (1.0 - cos(pi / segments))

    def _inside(self, point: Array, direction: Array) -> Array:
        # x^2 + y^2 <= radius(z)^2 also holds in the mirrored cone beyond the apex, which the caps cut off.
        taper = (self.top_radius - self.bottom_radius) / self.height
        radius = 0.5 * (self.bottom_radius + self.top_radius) + taper * point[..., 2]
        growth = taper * direction[..., 2]
        flat, across = point[..., :2], direction[..., :2]
        distance = np.linalg.norm(flat, axis=-1)
        a = dot(across, across) - growth**2
        first, second = quadric(a, dot(flat, across) - growth * radius, (distance - radius) * (distance + radius))
        bottom, top = between(point[..., 2], direction[..., 2], np.array(self.height / 2))
        # Between the roots for a >= 0, before and behind them for a steep line.
        steep = a < 0
        start, end = np.where(steep, bottom, np.maximum(bottom, first)), np.minimum(top, np.where(steep, first, second))
        again, last = np.where(steep, np.maximum(bottom, second), 0.0), np.where(steep, top, 0.0)
        return np.stack([np.stack([start, end], axis=-1), np.stack([again, last], axis=-1)], axis=-2)


class _Spheres(Solid):
    """Base class of disjoint spheres: bodies, or cavities in one."""

    @abstractmethod
    def parts(self) -> tuple[tuple[solids.Sphere, int], ...]:
        """Spheres, each with 1 for a body or -1 for a cavity."""

    def _solids(self) -> list[tuple[Sphere, int]]:
        return [(Sphere(sphere.center, sphere.radius), sign) for sphere, sign in self.parts()]

    @property
    def volume(self) -> float:
        """Exact volume in cubic metres."""
        return sum(sign * sphere.volume for sphere, sign in self._solids())

    def sagitta(self, segments: int = 64) -> float:
        """Upper bound in metres on the distance between the surface and the mesh: that of the largest sphere."""
        return max(sphere.sagitta(segments) for sphere, _ in self._solids())

    def _length(self, origins: Array, directions: Array) -> Array:
        return np.maximum(sum(sign * sphere._length(origins, directions) for sphere, sign in self._solids()), 0.0)


@dataclass(frozen=True)
class SphericalShell(solids.SphericalShell, _Spheres):
    """Hollow sphere: the points between the radii `inner` and `outer` about `center`, in metres."""


@dataclass(frozen=True)
class TwoSpheres(solids.Spheres, _Spheres):
    """Two disjoint spheres."""

    first: solids.Sphere
    second: solids.Sphere

    def __post_init__(self) -> None:
        distance = np.linalg.norm(np.subtract(self.first.center, self.second.center))
        require_measures(self, bool(distance > self.first.radius + self.second.radius))

    def parts(self) -> tuple[tuple[solids.Sphere, int], ...]:
        return (self.first, 1), (self.second, 1)
