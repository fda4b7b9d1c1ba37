"""Helpers of the analytic solids: surfaces of revolution, and lines against slabs and quadrics without cancellation."""

from __future__ import annotations

from math import pi

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.geometry.mesh import Mesh


def revolve(profile: npt.ArrayLike, segments: int, closed: bool = False) -> tuple[Array, npt.NDArray[np.int32]]:
    """Surface of revolution of a profile around z; outwards where the solid is on the left of the profile's course.

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
        raise InputError("a surface of revolution", f"{len(radius)} points, {segments} segments", "give 3 or more")
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
