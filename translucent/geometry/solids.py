"""Solids of simple shapes as meshes of any resolution: spheres, ellipsoids, boxes, tori and hollow spheres.

Solids of revolution stand around z.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import isfinite, pi

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh

Vector = tuple[float, float, float]

ORIGIN: Vector = (0.0, 0.0, 0.0)


def revolve(profile: npt.ArrayLike, segments: int, closed: bool = False) -> tuple[Array, npt.NDArray[np.int32]]:
    """Surface of revolution of a profile around z; the solid must be on the left of the profile.

    Parameters
    ----------
    profile : array_like (k, 2)
        Radius and z in metres; points on the axis have radius 0 exactly and become one vertex.
    segments : int
        Copies of the profile around the axis, at least 3.
    closed : bool
        Whether the last point is joined to the first.

    Returns
    -------
    vertices : (n, 3) float64
    faces : (m, 3) int32
    """
    radius, z = np.asarray(profile, dtype=np.float64).T
    if segments < 3 or len(radius) < 2 + closed:
        raise InputError(
            "a surface of revolution",
            f"{len(radius)} points and {segments} segments are too few",
            "use 3 points and 3 segments, or more",
        )
    angle = 2.0 * pi * np.arange(segments) / segments
    x, y = np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))
    grid = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=-1)
    index = np.arange(grid[..., 0].size).reshape(grid.shape[:2])
    index[radius == 0] = index[radius == 0][:, :1]
    rows = np.concatenate([index, index[:1]]) if closed else index
    ahead = np.roll(rows, -1, axis=1)
    a, b, c, d = (corner.ravel() for corner in (rows[:-1], ahead[:-1], ahead[1:], rows[1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, faces = np.unique(faces, return_inverse=True)
    return grid.reshape(-1, 3)[used], faces.reshape(-1, 3).astype(np.int32)


def unit_sphere(segments: int) -> Mesh:
    """Sphere of radius 1 around the origin, of `segments` meridians and half as many rings."""
    rings = max(segments // 2, 2)
    angle = pi * np.arange(rings + 1) / rings
    profile = np.stack([np.sin(angle), -np.cos(angle)], axis=1)
    profile[-1, 0] = 0.0
    return Mesh(*revolve(profile, segments))


class Round(ABC):
    """Base class of ellipsoids, whatever their parameters are called."""

    @abstractmethod
    def shape(self) -> tuple[Vector, Vector]:
        """Center and radii."""

    def tessellate(self, segments: int = 64) -> Mesh:
        """Closed mesh of `segments` meridians and half as many rings."""
        center, radii = self.shape()
        unit = unit_sphere(segments)
        return Mesh(unit.vertices * radii + center, unit.faces, name=type(self).__name__.lower())


@dataclass(frozen=True)
class Sphere(Round):
    """Sphere of all points within `radius` metres of `center`."""

    center: Vector = ORIGIN
    radius: float = 1.0

    def __post_init__(self) -> None:
        require_measures(self, self.radius > 0, self.radius, *self.center)

    def shape(self) -> tuple[Vector, Vector]:
        """Center and radii."""
        return self.center, (self.radius, self.radius, self.radius)


@dataclass(frozen=True)
class Ellipsoid(Round):
    """Axis-aligned ellipsoid, with `radii` in metres."""

    center: Vector = ORIGIN
    radii: Vector = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        require_measures(self, min(self.radii) > 0, *self.radii, *self.center)

    def shape(self) -> tuple[Vector, Vector]:
        """Center and radii."""
        return self.center, self.radii


@dataclass(frozen=True)
class Box:
    """Axis-aligned box between the corners `low` and `high`, in metres."""

    low: Vector = (-0.5, -0.5, -0.5)
    high: Vector = (0.5, 0.5, 0.5)

    def __post_init__(self) -> None:
        require_measures(self, all(a < b for a, b in zip(self.low, self.high, strict=True)), *self.low, *self.high)

    @classmethod
    def slab(cls, size: tuple[float, float] = (1.0, 1.0), thickness: float = 1e-3) -> Box:
        """Plate centered on the origin: `size` along x and y, `thickness` along z, in metres."""
        high = (size[0] / 2, size[1] / 2, thickness / 2)
        return cls((-high[0], -high[1], -high[2]), high)

    def tessellate(self, segments: int = 1) -> Mesh:
        """Closed mesh of 12 faces."""
        corners = np.array([[(self.low, self.high)[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
        quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)], np.int32)
        return Mesh(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), name="box")


@dataclass(frozen=True)
class Torus:
    """Torus around z through the origin: a tube of radius `minor` about a circle of radius `major`, in metres."""

    major: float = 1.0
    minor: float = 0.25

    def __post_init__(self) -> None:
        require_measures(self, 0 < self.minor < self.major, self.major, self.minor)

    def tessellate(self, segments: int = 64) -> Mesh:
        """Closed mesh of `segments` sections with half as many sides."""
        angle = 2.0 * pi * np.arange(segments // 2) / max(segments // 2, 1)
        profile = np.stack([self.major + self.minor * np.cos(angle), self.minor * np.sin(angle)], axis=1)
        return Mesh(*revolve(profile, segments, closed=True), name="torus")


class Spheres(ABC):
    """Base class of disjoint spheres: bodies, or cavities in one."""

    @abstractmethod
    def parts(self) -> tuple[tuple[Sphere, int], ...]:
        """Spheres, each with 1 for a body or -1 for a cavity."""

    def tessellate(self, segments: int = 64) -> Mesh:
        """Closed mesh of one part per sphere; a cavity's part is wound towards its center."""
        meshes = [(sphere.tessellate(segments), sign) for sphere, sign in self.parts()]
        step = len(meshes[0][0].vertices)
        faces = np.concatenate([mesh.faces[:, ::sign] + i * step for i, (mesh, sign) in enumerate(meshes)])
        return Mesh(np.concatenate([mesh.vertices for mesh, _ in meshes]), faces, name="spheres")


@dataclass(frozen=True)
class SphericalShell(Spheres):
    """Hollow sphere: the points between the radii `inner` and `outer` about `center`, in metres."""

    outer: float = 1.0
    inner: float = 0.5
    center: Vector = ORIGIN

    def __post_init__(self) -> None:
        require_measures(self, 0 < self.inner < self.outer, self.outer, self.inner, *self.center)

    def parts(self) -> tuple[tuple[Sphere, int], ...]:
        """Spheres, each with 1 for a body or -1 for a cavity."""
        return (Sphere(self.center, self.outer), 1), (Sphere(self.center, self.inner), -1)


def require_measures(solid: object, holds: bool, *numbers: float) -> None:
    """Raise `InputError` unless the measures of a solid are finite, and a condition holds."""
    if not (holds and all(isfinite(number) for number in numbers)):
        raise InputError(
            str(solid),
            "these dimensions do not describe a solid",
            "give finite, positive dimensions in ascending order",
        )
