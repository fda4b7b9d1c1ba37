"""Caustics on opaque objects: photons that Embree follows, and whose light is spread over discs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from translucent.arrays import Array
from translucent.cpu.light_paths import EmbreeLightPaths
from translucent.diffusion.photons import photon_segments
from translucent.formulas import optics
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster
from translucent.planning.caustics import Caustics
from translucent.planning.rendered import darkened
from translucent.reference.surface_light import SurfaceLight
from translucent.scene.scene import Light, Scene

#: Photons that the disc of one holds: the noise of light at a point is 1.15 over the root of them.
GATHERED = 64

#: Largest height of a photon over the plane of the point, in radii of its disc.
FLAT = 0.2

#: Least radius of a disc, as a share of the scene's diagonal.
LEAST_RADIUS = 1e-4

#: Factor between the largest and the smallest radius of discs that are looked for together.
TOGETHER = 1.5

#: Points at which light is gathered together.
BATCH = 1 << 14


class CausticLight(SurfaceLight):
    """Light that reaches surfaces, and that of photons on opaque ones (Jensen 1996).

    The light of each photon is spread over a disc that holds so many of its neighbors (Breiman, Meisel & Purcell 1977,
    "Variable kernel estimates"). What the nearest photons of a point carry over the area that they lie in would, added
    up over all points, be more than they carry: far off a caustic it falls as slowly as the squared distance.

    Parameters
    ----------
    scene : Scene
        As shown, with its eye as the origin of points.
    sheets, meshes
        As `EmbreeLightPaths` takes them.
    caustics : Caustics
    bending : frozenset of int
        Objects that no straight light of lamps passes, since photons carry it.
    """

    def __init__(
        self,
        scene: Scene,
        sheets: tuple[float | None, ...],
        meshes: Mapping[Mesh, RayCaster],
        caustics: Caustics,
        bending: frozenset[int],
    ) -> None:
        super().__init__(EmbreeLightPaths(scene, sheets, meshes))
        self._dark = SurfaceLight(EmbreeLightPaths(darkened(scene, bending), sheets, meshes))
        self._discs = _discs(*_landed(scene, caustics), scene)

    def straight(self, light: Light, points: Array, before: float) -> Array:
        """(k, 3): as of `SurfaceLight`; to opaque objects, for which `before` is 0, past all that bends light."""
        return self._dark.straight(light, points, before) if before == 0.0 else super().straight(light, points, before)

    def on_opaque(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) at points (k, 3) of opaque objects with unit normals (k, 3)."""
        return np.asarray(super().on_opaque(points, normals) + self._gathered(points, normals))

    def _gathered(self, points: Array, normals: Array) -> Array:
        """(k, 3): irradiance of the photons that come from before the surface, and whose discs points are on."""
        found = np.zeros(points.shape)
        for first in range(0, len(points), BATCH):
            part = slice(first, first + BATCH)
            places = cKDTree(points[part])
            for discs in self._discs:
                found[part] += discs.light(places, normals[part])
        return found


@dataclass(frozen=True, eq=False)
class _Discs:
    """Photons with discs of about the same size: points from the eye, directions, power (n, 3) and radii (n,)."""

    points: Array
    ways: Array
    power: Array
    radius: Array

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.points)

    def light(self, places: cKDTree, normals: Array) -> Array:
        """(k, 3): irradiance at places with unit normals (k, 3)."""
        near = places.sparse_distance_matrix(self._tree, float(self.radius.max()), output_type="ndarray")
        place, photon, distance = near["i"], near["j"], near["v"] / self.radius[near["j"]]
        height = ((self.points[photon] - places.data[place]) * normals[place]).sum(axis=1)
        seen = (distance < 1.0) & (np.abs(height) < FLAT * self.radius[photon])
        seen &= (self.ways[photon] * normals[place]).sum(axis=1) < 0.0
        place, photon, distance = place[seen], photon[seen], distance[seen]
        with np.errstate(under="ignore"):
            # Those near the edge count less (Epanechnikov), so that no photon comes or goes at once.
            share = 2.0 * (1.0 - distance**2) / (np.pi * self.radius[photon] ** 2)
            light = share[:, None] * self.power[photon]
            return np.stack([np.bincount(place, light[:, channel], len(normals)) for channel in range(3)], axis=1)


def _discs(points: Array, ways: Array, power: Array, scene: Scene) -> list[_Discs]:
    """Discs of photons by their size."""
    if not len(points):
        return []
    points = points - scene.camera.eye
    radius = cKDTree(points).query(points, k=[min(GATHERED, len(points))])[0][:, 0]
    radius = np.maximum(radius, LEAST_RADIUS * scene.diagonal)
    size = np.floor(np.log(radius) / np.log(TOGETHER))
    kinds = [np.flatnonzero(size == one) for one in np.unique(size)]
    return [_Discs(points[own], ways[own], power[own], radius[own]) for own in kinds]


def _landed(scene: Scene, caustics: Caustics) -> tuple[Array, Array, Array]:
    """Points, directions and power (n, 3) of the photons that interfaces have turned, where they land."""
    parts = [np.zeros((3, 0, 3))]
    for segments in photon_segments(scene, caustics.photons, caustics.seed):
        ends = segments.where(segments.lands & segments.bent)
        points = ends.origins + ends.length[:, None] * ends.directions
        with np.errstate(under="ignore"):
            left = ends.power * optics.transmittance(ends.extinction * ends.length[:, None])
        parts.append(np.stack([points, ends.directions, left]))
    points, ways, power = np.concatenate(parts, axis=1)
    return points, ways, power
