"""Light on surfaces, with colored shadows: of lights, and of an environment by some directions."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from translucent.arrays import Array
from translucent.errors import InputError
from translucent.planning.limits import SHEET_ON_OPAQUE
from translucent.reference.light_paths import PATHS, LightPaths, way_of
from translucent.reference.sheets import sheet_thicknesses
from translucent.scene.scene import Light, Scene
from translucent.scene.shadow_directions import shadow_directions


class SurfaceLight:
    """Light that reaches surfaces straight on, through media and sheets and past opaque objects.

    Parameters
    ----------
    paths : LightPaths
        Through the scene. Points are in metres from the eye of its camera, along the axes of the world.
    """

    def __init__(self, paths: LightPaths) -> None:
        self.paths, self.scene = paths, paths.scene
        # A painted sheet does not shadow its own paint.
        self._before = 2.0 * SHEET_ON_OPAQUE * paths.scene.diagonal

    def on_opaque(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) at points (k, 3) of opaque objects with unit normals (k, 3)."""
        return self._irradiance(points, normals, 0.0)

    def on_interfaces(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) on layers, and on paint of interfaces; parameters as for `on_opaque`."""
        return self._irradiance(points, normals, self._before)

    def to_interfaces(self, light: Light, points: Array) -> Array:
        """(k, 3): transmittance of the ways from one of `LightPaths.lights` to points (k, 3) of interfaces."""
        return self.passed(points, *way_of(light, points), self._before)

    def _irradiance(self, points: Array, normals: Array, before: float) -> Array:
        irradiance = self.scene.environment.irradiance_on(normals)
        if self.scene.environment_shadows:
            irradiance = irradiance * self._share_of_sky(points, normals, before)
        for light in self.paths.lights:
            arriving = np.array(light.irradiance_on(points, normals))
            lit = np.flatnonzero(arriving.any(axis=1))
            with np.errstate(under="ignore"):
                arriving[lit] *= self.straight(light, points[lit], before)
                irradiance = irradiance + arriving
        return np.asarray(irradiance)

    def straight(self, light: Light, points: Array, before: float) -> Array:
        """(k, 3): transmittance of straight ways from one of `LightPaths.lights` that end `before` points (k, 3)."""
        return self.passed(points, *way_of(light, points), before)

    def _share_of_sky(self, points: Array, normals: Array, before: float) -> Array:
        """(k, 3): share of the environment's irradiance that is left, by its `shadow_directions`."""
        sky = shadow_directions(self.scene.environment, self.scene.environment_shadows)
        left, total = np.zeros((2, *points.shape))
        for towards, irradiance in zip(*sky, strict=True):
            cosine = np.maximum(normals @ towards, 0.0)
            lit = np.flatnonzero(cosine) if irradiance.any() else np.empty(0, np.int64)
            travel = np.broadcast_to(-towards, (len(lit), 3))
            with np.errstate(under="ignore"):
                arriving = cosine[lit, None] * irradiance
                total[lit] += arriving
                left[lit] += arriving * self.passed(points[lit], travel, np.full(len(lit), np.inf), before)
        return np.where(total > 0, left / np.where(total > 0, total, 1.0), 1.0)

    def passed(self, points: Array, travel: Array, distance: Array, before: float = 0.0) -> Array:
        """(k, 3): transmittance of ways in directions (k, 3) over distances (k,) that end `before` points (k, 3)."""
        passed = np.ones(points.shape)
        for begin in range(0, len(points), PATHS):
            some = slice(begin, begin + PATHS)
            ends, left = points[some] - before * travel[some], np.maximum(distance[some] - before, 0.0)
            passed[some], _ = self.paths.transmittance(ends, travel[some], left)
        return passed


def light_transmittance(scene: Scene, light: int, points: npt.ArrayLike) -> Array:
    """Transmittance of the straight ways from a light to points: exp(-sum sigma_t d), 0 behind opaque surfaces.

    What dims the light that reaches opaque objects. Interfaces neither bend nor dim it, and layers (`Surface.opacity`)
    let it pass. A surface that a point or the light lies on, to 1e-9 of the scene's size, does not shadow it.

    Parameters
    ----------
    scene : Scene
    light : int
        Index into `Scene.lights`.
    points : array_like (k, 3)
        In world coordinates.

    Returns
    -------
    (k, 3) float64
        By color, 0 to 1.

    Raises
    ------
    InputError
        If there is no such light, or the points are no finite array (k, 3).
    """
    if not 0 <= light < len(scene.lights):
        raise InputError(f"light {light} of a scene", f"it has {len(scene.lights)}", "count from 0")
    places = np.asarray(points, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3 or not np.isfinite(places).all():
        raise InputError("points in a scene", f"shape {places.shape}, or not finite", "give an array (k, 3) in metres")
    paths = LightPaths(scene, sheet_thicknesses(scene))
    from_eye = places - scene.camera.eye
    return SurfaceLight(paths).passed(from_eye, *way_of(paths.lights[light], from_eye))
