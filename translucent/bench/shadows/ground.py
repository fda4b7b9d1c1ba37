"""Ground in one light: what reaches it in truth, and by each way of throwing shadows."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from translucent import reference
from translucent.arrays import Array, Mask
from translucent.bench.record import ErrorStatistics
from translucent.frames.frame import Frame
from translucent.frames.metrics import interior
from translucent.media.medium import Medium
from translucent.planning.shadow_maps import ShadowMaps
from translucent.reference.light_paths import LightPaths, way_of
from translucent.reference.sheets import sheet_thicknesses
from translucent.reference.tracer import Lines
from translucent.renderer import Renderer
from translucent.scene.scene import Object, Scene

#: Map of the planner, at which shortcuts are drawn, and of which pictures are shown.
USUAL = 1024

#: Distance from a point of the ground to what may shadow it, as a share of the scene: it is not its own shadow.
_CONTACT = 1e-9

#: Light beside which nothing is seen, as a share of that where it is bright.
_FAINT = 0.01


class Ground:
    """Ground of a scene, its last object, in the light of its one lamp.

    Parameters
    ----------
    renderer : Renderer
    scene : Scene
    pixels : int
        Width and height of pictures.

    Attributes
    ----------
    truth : (h, w, 3) float64
        Transmittance of the ways from the light to the points that pixels see.
    seconds : float
        That it took.
    bare : (h, w, 3) float64
        Radiance with nothing in the light, for which bodies are made clear.
    frame : Frame
        The picture.
    bright : float
        Of `bare` where it is bright.
    seen : (h, w) bool
        Pixels that show the ground by itself, in light.
    inside, away : (h, w) bool
        Of these, those away from all outlines of shadows, inner ones included; and of those, the ones in the shadow.
    near : (h, w) bool
        Of these, those in the shadow or next to it.
    """

    def __init__(self, renderer: Renderer, scene: Scene, pixels: int) -> None:
        self.renderer, self.scene, self.size = renderer, scene, (pixels, pixels)
        began = time.perf_counter()
        rays = scene.camera.rays(self.size)
        origins, ways = (np.broadcast_to(part, (pixels, pixels, 3)) for part in rays)
        height = float(scene.objects[-1].bounds[0, 1])
        points = origins + ((height - origins[..., 1]) / ways[..., 1])[..., None] * ways
        self.truth = reference.light_transmittance(scene, 0, points.reshape(-1, 3)).reshape(points.shape)
        self.seconds = time.perf_counter() - began
        self.bare = self._radiance(self._with([]), USUAL)
        self.frame = self._drawn(scene, USUAL)
        self.bright = float(np.quantile(self.bare, 0.99))
        _, nearest = reference.opaque_counts(scene, self.size)
        ground = ~self.frame.coverage & (nearest == len(scene.objects) - 1)
        self.seen: Mask = ground & np.asarray(self.bare.min(axis=-1) > _FAINT * self.bright)
        inside = interior(self.seen)
        for counts in _crossings(scene, points):
            inside &= interior(counts)
        dimmed = np.asarray((self.truth < 1.0).any(axis=-1))
        self.inside = inside & self.seen
        self.away = self.inside & dimmed
        self.near = (dimmed | ~interior(dimmed)) & self.seen

    def shown(self, size: int = USUAL) -> Array:
        """(h, w, 3): transmittance on the ground, as pictures with maps of this size show it."""
        return self._shared(self._radiance(self.scene, size))

    def unblocked(self, objects: Sequence[int]) -> Array:
        """Share of the light that opaque shadow maps of these objects leave."""
        stones = [dataclasses.replace(self.scene.objects[i], medium=None, surface=None, density=None) for i in objects]
        return self._shared(self._radiance(self._with(stones), USUAL))

    def constant(self) -> Array:
        """Each body as thick everywhere as the share of its diagonal that fits all of the shadow best."""
        from scipy.optimize import minimize_scalar

        parts = []
        for i, item in enumerate(self.scene.objects[:-1]):
            extinction = np.full(3, np.inf) if item.medium is None else np.asarray(item.medium.extinction)
            across = extinction * float(np.linalg.norm(item.bounds[1] - item.bounds[0]))
            parts.append((self.unblocked([i]), across))

        def shown(share: float) -> Array:
            with np.errstate(under="ignore"):
                dimmed = [left + (1.0 - left) * np.exp(-share * across) for left, across in parts]
                return np.asarray(np.prod(dimmed, axis=0))

        def off(share: float) -> float:
            return float(((shown(share) - self.truth)[self.near] ** 2).mean())

        return shown(float(minimize_scalar(off, bounds=(1e-3, 1.0), method="bounded").x))

    def edges(self, found: Array) -> float:
        """Mean absolute error, by the worst channel, over the shadow and next to it."""
        return float(np.abs(found - self.truth).max(axis=-1)[self.near].mean())

    def _with(self, stones: Sequence[Object]) -> Scene:
        """The scene with these objects in place of its own, and a body of nothing, since there has to be one."""
        clear = dataclasses.replace(self.scene.bodies[0], medium=Medium(), surface=None)
        return dataclasses.replace(self.scene, objects=[clear, *stones, self.scene.objects[-1]])

    def _drawn(self, scene: Scene, size: int) -> Frame:
        return self.renderer.render(scene, self.size, shadows=ShadowMaps(size))

    def _radiance(self, scene: Scene, size: int) -> Array:
        return np.asarray(self._drawn(scene, size).radiance, np.float64)

    def _shared(self, radiance: Array) -> Array:
        """Radiance of the ground as a share of what it has with nothing in the light."""
        lit = self.bare > 0
        return np.where(lit, radiance / np.where(lit, self.bare, 1.0), 1.0)


def errors_of(differences: Array) -> ErrorStatistics:
    """Statistics of differences (n, 3), each by its worst channel."""
    worst = np.abs(differences).max(axis=-1)
    if not worst.size:
        raise ValueError("no point is away from outlines")
    p50, p99, p999 = (float(np.quantile(worst, share)) for share in (0.5, 0.99, 0.999))
    return ErrorStatistics(
        float(np.sqrt((worst**2).mean())), p50, p99, p999, float(worst.max()), float(np.mean(differences))
    )


def _crossings(scene: Scene, points: Array) -> list[npt.NDArray[np.int64]]:
    """Number of crossings with each object but the ground of the ways from points (h, w, 3) to the light."""
    paths = LightPaths(scene, sheet_thicknesses(scene))
    places = points.reshape(-1, 3) - scene.camera.eye
    travel, distance = way_of(paths.lights[0], places)
    lines = Lines(places, -travel, np.full(len(places), _CONTACT * scene.diagonal), distance)
    objects = paths.tracer.objects[:-1]
    return [np.bincount(one.hits(lines).pixel, minlength=len(places)).reshape(points.shape[:2]) for one in objects]
