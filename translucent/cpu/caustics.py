"""Caustics on opaque objects: photons that Embree follows, gathered around each point."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from translucent.arrays import Array
from translucent.cpu.light_paths import EmbreeLightPaths
from translucent.diffusion.photon_flights import photon_flights
from translucent.formulas import optics
from translucent.geometry.embree import EmbreeMesh
from translucent.geometry.mesh import Mesh
from translucent.planning.caustic_plan import darkened
from translucent.planning.caustics import Caustics
from translucent.reference.surface_light import SurfaceLight
from translucent.scene.scene import Light, Scene

#: Photons that a point gathers: the noise of its light is 1.15 over the root of them.
GATHERED = 64

#: Largest height of a photon over the plane of the point, in radii of what is gathered.
FLAT = 0.2


class CausticLight(SurfaceLight):
    """Light that reaches surfaces, and that of photons on opaque ones (Jensen 1996).

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
        meshes: Mapping[Mesh, EmbreeMesh],
        caustics: Caustics,
        bending: frozenset[int],
    ) -> None:
        super().__init__(EmbreeLightPaths(scene, sheets, meshes))
        self._dark = SurfaceLight(EmbreeLightPaths(darkened(scene, bending), sheets, meshes))
        points, self._ways, self._power = _landed(scene, caustics)
        self._points = points - scene.camera.eye
        self._tree = cKDTree(self._points) if len(points) else None

    def straight(self, light: Light, points: Array, before: float) -> Array:
        """(k, 3): as of `SurfaceLight`; to opaque objects, for which `before` is 0, past all that bends light."""
        return self._dark.straight(light, points, before) if before == 0.0 else super().straight(light, points, before)

    def on_opaque(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) at points (k, 3) of opaque objects with unit normals (k, 3)."""
        return np.asarray(super().on_opaque(points, normals) + self._gathered(points, normals))

    def _gathered(self, points: Array, normals: Array) -> Array:
        """(k, 3): power of the nearest photons on the same side of the same plane, over the area that they lie in."""
        if self._tree is None or not len(points):
            return np.zeros(points.shape)
        count = min(GATHERED, len(self._points))
        distance, found = (part.reshape(len(points), count) for part in self._tree.query(points, k=count))
        radius = np.maximum(distance[:, -1:], np.finfo(np.float64).tiny)
        height = np.einsum("kni,ki->kn", self._points[found] - points[:, None], normals)
        lit = np.einsum("kni,ki->kn", self._ways[found], normals) < 0.0
        with np.errstate(under="ignore"):
            # Those near the edge count less (Epanechnikov), so that no photon comes or goes at once.
            share = 2.0 * (1.0 - np.minimum(distance / radius, 1.0) ** 2) / (np.pi * radius**2)
            share = np.where(lit & (np.abs(height) < FLAT * radius), share, 0.0)
            return np.asarray(np.einsum("kn,knc->kc", share, self._power[found]))


def _landed(scene: Scene, caustics: Caustics) -> tuple[Array, Array, Array]:
    """Points, directions and power (n, 3) of the photons that interfaces have turned, where they land."""
    parts = [np.zeros((3, 0, 3))]
    for flights in photon_flights(scene, caustics.photons, caustics.seed):
        ends = flights.where(flights.lands & flights.bent)
        points = ends.origins + ends.length[:, None] * ends.directions
        with np.errstate(under="ignore"):
            left = ends.power * optics.transmittance(ends.extinction * ends.length[:, None])
        parts.append(np.stack([points, ends.directions, left]))
    points, ways, power = np.concatenate(parts, axis=1)
    return points, ways, power
