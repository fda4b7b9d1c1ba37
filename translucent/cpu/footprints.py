"""Footprints of pixels along beams that bend, as `shaders/transport/footprint.glsl` has them (Igehy 1999).

Differentials (k, 2, 3) of points and directions are those for a step to the right and for one down in the picture.
"""

from __future__ import annotations

import numpy as np

from translucent.arrays import Array, Integers
from translucent.cpu.beams import Beams
from translucent.cpu.caster import Caster
from translucent.cpu.meetings import Meetings, Places
from translucent.cpu.vectors import dot
from translucent.formulas.footprint import FOOTPRINT_STEP, LEAST_ACROSS
from translucent.scene.camera import Camera


def first_footprints(camera: Camera, directions: Array, pixel: float, samples: int, radius: float) -> Array:
    """(k, 2, 2, 3): differentials of points, in radii, and of directions, of rays of a camera where they start.

    `pixel` is the extent of a pixel in metres, or in metres at distance 1; where it is 0, footprints are (k, 0, 2, 3).
    """
    if pixel == 0.0:
        return np.empty((len(directions), 0, 2, 3))
    aside = FOOTPRINT_STEP * samples**-0.5 * pixel * np.stack([camera.right, -camera.up])
    found = np.zeros((len(directions), 2, 2, 3))
    if camera.fov_y is None:
        found[:, 0] = aside / radius
    else:
        ahead = directions @ camera.forward
        found[:, 1] = ahead[:, None, None] * (aside - (directions @ aside.T)[..., None] * directions[:, None])
    return found


def moved_on(footprints: Array, path: Array) -> Array:
    """Footprints after paths (k,)."""
    moved = footprints.copy()
    moved[:, :1] += path[:, None, None, None] * footprints[:, 1:]
    return moved


def parted(caster: Caster, beams: Beams, places: Places, met: Meetings) -> tuple[Array, Array]:
    """Footprints of the reflected and the refracted branches of beams at interfaces."""
    directions, normals, incident = beams.directions, met.normals, beams.footprint[:, 1]
    points = onto_planes(beams.footprint[:, 0], directions, caster.faces.outward[places.face])
    turns = normal_differentials(caster, places.face, beams.origins, points, normals)
    mirrored = reflected_differentials(incident, turns, directions, normals)
    refracted = refracted_differentials(incident, turns, directions, normals, met.ior)
    refracted = np.where((places.before == places.after)[:, None, None], incident, refracted)
    return np.stack([points, mirrored], axis=1), np.stack([points, refracted], axis=1)


def onto_planes(points: Array, directions: Array, flat: Array) -> Array:
    """Differentials of points where the neighbors of beams meet the planes of faces with unit normals (k, 3)."""
    across = dot(flat, directions)
    least = np.where(across < 0.0, np.minimum(across, -LEAST_ACROSS), np.maximum(across, LEAST_ACROSS))
    return np.asarray(points - _outer(directions, _along(points, flat) / least[:, None]))


def normal_differentials(caster: Caster, face: Integers, origins: Array, points: Array, normals: Array) -> Array:
    """Differentials of smooth normals (k, 3), which are turned as these are, at places on faces."""
    corners = caster.smooth[face].astype(np.float64)
    weights = caster.barycentric(face, origins)
    first, second = caster.faces.edges[face].transpose(1, 0, 2)
    across = np.cross(first, second)
    with np.errstate(under="ignore"):
        area = np.maximum(dot(across, across), 1e-300)[:, None]
        seconds = _along(points, np.cross(second, across)) / area
        thirds = _along(points, np.cross(across, first)) / area
        change = _outer(corners[:, 1] - corners[:, 0], seconds) + _outer(corners[:, 2] - corners[:, 0], thirds)
        smooth = np.einsum("kij,ki->kj", corners, weights)
        length = np.maximum(np.sqrt(dot(smooth, smooth)), 1e-30)
        smooth /= length[:, None]
        turned = np.where(dot(smooth, normals) < 0.0, -1.0, 1.0) / length
        return np.asarray(turned[:, None, None] * (change - _outer(smooth, _along(change, smooth))))


def reflected_differentials(incident: Array, turns: Array, directions: Array, normals: Array) -> Array:
    """Differentials of mirrored directions; `turns` (k, 2, 3) are those of the normals."""
    cosines = _along(incident, normals) + _along(turns, directions)
    facing = dot(directions, normals)[:, None, None]
    return bounded(incident - 2.0 * (facing * turns + _outer(normals, cosines)))


def refracted_differentials(incident: Array, turns: Array, directions: Array, normals: Array, ior: Array) -> Array:
    """Differentials of refracted directions; 0 under total internal reflection."""
    cosine = -dot(directions, normals)
    inside = 1.0 - (1.0 - cosine * cosine) / (ior * ior)
    passed = inside > 0.0
    inside = np.maximum(np.sqrt(np.maximum(inside, 0.0)), LEAST_ACROSS)
    cosines = -(_along(incident, normals) + _along(turns, directions))
    along = (1.0 / ior - cosine / (ior * ior * inside))[:, None] * cosines
    found = incident / ior[:, None, None] + (cosine / ior - inside)[:, None, None] * turns + _outer(normals, along)
    return np.where(passed[:, None, None], bounded(found), 0.0)


def bounded(directions: Array) -> Array:
    """Differentials none of which is longer than 1, as wide as all directions to one side."""
    length = np.sqrt(np.einsum("kij,kij->ki", directions, directions))
    return np.asarray(directions / np.maximum(length, 1.0)[..., None])


def ellipses(directions: Array) -> tuple[Array, Array]:
    """Longer half axis (k, 3) and shorter one (k,) of footprints: their standard deviations."""
    right, down = directions[:, 0], directions[:, 1]
    wide, high, both = dot(right, right), dot(down, down), dot(right, down)
    middle, off = 0.5 * (wide + high), np.hypot(0.5 * (wide - high), both)
    turn = 0.5 * np.arctan2(2.0 * both, wide - high)[:, None]
    axis = (np.cos(turn) * right + np.sin(turn) * down) / np.sqrt(12.0)
    return axis, np.sqrt(np.maximum(middle - off, 0.0) / 12.0)


def _along(differentials: Array, vectors: Array) -> Array:
    """(k, 2): scalar products of differentials (k, 2, 3) with vectors (k, 3)."""
    return np.asarray(np.einsum("kij,kj->ki", differentials, vectors))


def _outer(vectors: Array, shares: Array) -> Array:
    """(k, 2, 3): the products of vectors (k, 3) with two numbers each (k, 2)."""
    return np.asarray(vectors[:, None, :] * shares[..., None])
