"""Radiance of rays that leave a scene, averaged over their footprints: of its environment, or of its background."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from translucent.arrays import Array, Integers
from translucent.cpu.interactions import BranchInteractions, InterfaceHits
from translucent.cpu.interior_list import Branches
from translucent.formulas.sampling import ALPHA_OF_DEVIATION, FOOTPRINT_STEP, LEAST_ACROSS, LEAST_BREADTH, MOST_LOOKUPS
from translucent.geometry.ray_caster import SceneRayCaster, dot
from translucent.reference.hits import Rays
from translucent.reference.refracted import places_on_backdrop
from translucent.scene.camera import Camera
from translucent.scene.environment import Environment, FilteredEnvironment, equirectangular_uv, filtered
from translucent.scene.environment_map import bilinear
from translucent.scene.scene import Scene


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
    """Footprints after the rays have moved on by lengths (k,)."""
    moved = footprints.copy()
    moved[:, :1] += path[:, None, None, None] * footprints[:, 1:]
    return moved


def split_footprints(
    caster: SceneRayCaster, branches: Branches, places: InterfaceHits, found: BranchInteractions
) -> tuple[Array, Array]:
    """Footprints of the reflected and the refracted branches at interfaces."""
    directions, normals, incident = branches.directions, found.at.normal, branches.footprint[:, 1]
    points = onto_planes(branches.footprint[:, 0], directions, caster.faces.outward[places.face])
    normal_changes = normal_differentials(caster, places.face, branches.origins, points, normals)
    mirrored = reflected_differentials(incident, normal_changes, directions, normals)
    refracted = refracted_differentials(incident, normal_changes, directions, normals, found.at.ior)
    refracted = np.where(found.at.thin_walled[:, None, None], incident, refracted)
    return np.stack([points, mirrored], axis=1), np.stack([points, refracted], axis=1)


def onto_planes(points: Array, directions: Array, flat: Array) -> Array:
    """Differentials of points where the neighbors of branches cross the planes of faces with unit normals (k, 3)."""
    across = dot(flat, directions)
    least = np.where(across < 0.0, np.minimum(across, -LEAST_ACROSS), np.maximum(across, LEAST_ACROSS))
    return np.asarray(points - _outer(directions, _along(points, flat) / least[:, None]))


def normal_differentials(
    caster: SceneRayCaster, face: Integers, origins: Array, points: Array, normals: Array
) -> Array:
    """Differentials of smooth normals (k, 3) at points of faces."""
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


def reflected_differentials(incident: Array, normal_changes: Array, directions: Array, normals: Array) -> Array:
    """Differentials of mirrored directions; `normal_changes` (k, 2, 3) are those of the normals."""
    cosines = _along(incident, normals) + _along(normal_changes, directions)
    facing = dot(directions, normals)[:, None, None]
    return bounded(incident - 2.0 * (facing * normal_changes + _outer(normals, cosines)))


def refracted_differentials(
    incident: Array, normal_changes: Array, directions: Array, normals: Array, ior: Array
) -> Array:
    """Differentials of refracted directions; 0 under total internal reflection."""
    cosine = -dot(directions, normals)
    inside = 1.0 - (1.0 - cosine * cosine) / (ior * ior)
    passed = inside > 0.0
    inside = np.maximum(np.sqrt(np.maximum(inside, 0.0)), LEAST_ACROSS)
    cosines = -(_along(incident, normals) + _along(normal_changes, directions))
    along = (1.0 / ior - cosine / (ior * ior * inside))[:, None] * cosines
    found = (
        incident / ior[:, None, None] + (cosine / ior - inside)[:, None, None] * normal_changes + _outer(normals, along)
    )
    return np.where(passed[:, None, None], bounded(found), 0.0)


def bounded(directions: Array) -> Array:
    """Differentials of directions, clamped to length 1: as wide as all directions to one side."""
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


def _outer(vectors: Array, factors: Array) -> Array:
    """(k, 2, 3): the products of vectors (k, 3) with two numbers each (k, 2)."""
    return np.asarray(vectors[:, None, :] * factors[..., None])


class Surroundings:
    """Lookups of a scene's environment by branches of a ray tree.

    Parameters
    ----------
    scene : Scene
    aspect : float
        Width of the picture divided by its height.
    """

    def __init__(self, scene: Scene, aspect: float) -> None:
        self.scene, self.aspect, self.environment = scene, aspect, scene.environment

    @cached_property
    def _maps(self) -> FilteredEnvironment:
        """Maps of the environment's light, from that of a mirror to that of a surface of roughness 1."""
        return filtered(self.environment)

    def radiance(self, branches: Branches, rays: Rays) -> Array:
        """(n, 3): radiance along branches that leave the scene; `rays` are the same in metres from the eye.

        `Rays.backdrop` is where rays that have hit no interface are in the picture.
        """
        environment = self.environment
        if environment.seen is environment and environment.kind != "checkerboard":
            return self._light(environment, branches)
        radiance = self._background(environment.seen, branches, rays)
        mirrored = np.flatnonzero(branches.reflected)
        if mirrored.size:
            radiance[mirrored] = self._light(environment, branches.where(mirrored))
        return radiance

    def blurred(self, branches: Branches, directions: Array, roughness: float | Array) -> Array:
        """(n, 3): light of the environment in directions (n, 3), as mirrors of a roughness (n,) would blur it."""
        blur = np.broadcast_to(roughness, len(branches)) ** 4
        in_scattered = replace(branches, directions=directions, blur=blur, footprint=branches.footprint[:, :0])
        return self._light(self.environment, in_scattered)

    def _light(self, environment: Environment, branches: Branches) -> Array:
        blur = branches.blur
        # A gradient is smooth already.
        if environment.map is None or environment.map is not self.environment.map:
            return environment.lighting(branches.directions)
        if branches.footprint.size:
            return self._averaged(environment, branches)
        if not blur.any():
            return environment.lighting(branches.directions)
        return environment.scale * blurred_lookups(
            self._maps, equirectangular_uv(branches.directions, environment.turn), np.minimum(blur**0.25, 1.0)
        )

    def _averaged(self, environment: Environment, branches: Branches) -> Array:
        """(n, 3): light averaged over the footprints of branches."""
        axis, breadth = ellipses(branches.footprint[:, 1])
        longer = np.sqrt(dot(axis, axis))
        lookups = np.clip(np.ceil(longer / np.maximum(breadth, LEAST_BREADTH)), 1, MOST_LOOKUPS).astype(np.int64)
        breadth = np.maximum(breadth, longer / lookups)
        with np.errstate(under="ignore"):
            roughness = np.minimum(branches.blur + (ALPHA_OF_DEVIATION * breadth) ** 2, 1.0) ** 0.25
            # Between the map as it is and the first that is blurred, fractions are of the variance.
            sharpest = 1.0 / len(self._maps.levels)
            narrow = (branches.blur == 0.0) & (roughness < sharpest)
            roughness = np.where(narrow, sharpest * (roughness / sharpest) ** 4, roughness)
        own = np.repeat(np.arange(len(branches)), lookups)
        first = np.cumsum(lookups) - lookups
        along = (np.arange(len(own)) - first[own] + 0.5) / lookups[own] - 0.5
        aside = np.sqrt(12.0) * along[:, None] * axis[own]
        uv = equirectangular_uv(branches.directions[own] + aside, environment.turn)
        averages = np.add.reduceat(blurred_lookups(self._maps, uv, roughness[own]), first)
        return environment.scale * averages / lookups[:, None]

    def _background(self, visible: Environment, branches: Branches, rays: Rays) -> Array:
        if visible.kind != "checkerboard":
            return self._light(visible, branches)
        place, ahead = places_on_backdrop(self.scene, self.aspect, rays)
        bent = branches.depth > 0
        found = visible.radiance(rays.directions, np.where(bent[:, None], place, rays.backdrop))
        found[bent & ~ahead] = visible.mean
        return found


def blurred_lookups(maps: FilteredEnvironment, uv: Array, roughness: Array) -> Array:
    """(n, 3): lookups in prefiltered maps at (n, 2) for roughnesses (n,) from 0 to 1, linear between maps."""
    level = roughness * len(maps.levels)
    below = np.minimum(level.astype(np.int64), len(maps.levels) - 1)
    fraction = (level - below)[:, None]
    found = fraction * bilinear(maps.levels, below, uv)
    sharp, rough = np.flatnonzero(below == 0), np.flatnonzero(below > 0)
    found[sharp] += (1.0 - fraction[sharp]) * maps.sharp.at(uv[sharp])
    found[rough] += (1.0 - fraction[rough]) * bilinear(maps.levels, below[rough] - 1, uv[rough])
    return np.asarray(found)
