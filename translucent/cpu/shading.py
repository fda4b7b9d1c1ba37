"""Shading of a band of a picture: that of the reference, with light paths by Embree, and caustics by photons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from translucent.arrays import Array, Integers, slices
from translucent.cpu.threads import end_if_stopped
from translucent.diffusion.photons import photon_segments
from translucent.formulas import optics
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster, point_from
from translucent.planning.assembly import FALLBACK_SHEET
from translucent.planning.caustics import Caustics
from translucent.planning.passes import PassName
from translucent.planning.render_plan import RenderPlan
from translucent.planning.rendered import darkened
from translucent.reference.hits import Hits, Lines, Rays, SceneTracer, TracedObject, sorted_hits
from translucent.reference.intervals import sum_signs
from translucent.reference.light_paths import LightPaths, SurfaceLight
from translucent.reference.render import shade_hits
from translucent.reference.surfaces import sheet_thicknesses
from translucent.scene.scene import Light, Scene

#: Number of faces of one object on a line after which Embree looks for no more.
MOST_FACES = 64


class EmbreeLightPaths(LightPaths):
    """Straight paths from lights to points, with candidates by Embree and decisions in float64.

    Lines on which Embree's faces turn out to be others, or do not close a body, are traced as the reference does.
    What it may miss is a pair of faces that are within 2e-6 of the size of their mesh.

    Parameters
    ----------
    scene : Scene
    sheets : sequence of float or None
        As `sheet_thicknesses` gives them.
    meshes : mapping of Mesh to RayCaster
        All of the scene.
    """

    def __init__(self, scene: Scene, sheets: tuple[float | None, ...], meshes: Mapping[Mesh, RayCaster]) -> None:
        super().__init__(scene, sheets)
        self._meshes = meshes

    @cached_property
    def tracer(self) -> SceneTracer:
        """Ray caster for the objects."""
        found = SceneTracer(self.scene)
        found.objects = [
            _EmbreeObject(traced.body, traced.corners, self._meshes[traced.body.mesh], self.scene)
            for traced in found.objects
        ]
        return found


@dataclass(frozen=True, eq=False)
class _EmbreeObject(TracedObject):
    """Object whose candidate faces come from Embree."""

    embree: RayCaster
    scene: Scene

    def hits(self, lines: Lines) -> Hits:
        """All surfaces on the lines; `Hits.pixel` is the number of the line."""
        end_if_stopped()
        line, face = self._candidates(lines)
        hits = self.crossings(lines, [(line, face)])
        tried, crossed = (np.bincount(pixel, minlength=len(lines)) for pixel in (line, hits.pixel))
        doubtful = (tried != crossed) | (tried >= MOST_FACES)
        filled = self.body.medium is not None and self.body.sheet_thickness is None
        if filled or self.body.mesh.diagnosis.solid:
            doubtful |= sum_signs(hits, len(lines)) != 0
        if doubtful.any():
            rest = np.flatnonzero(doubtful)
            again = super().hits(lines.where(rest))
            parts = hits.where(~doubtful[hits.pixel]), replace(again, pixel=rest[again.pixel])
            hits = sorted_hits([(one.pixel, one.face, one.distance, one.sign, one.barycentric) for one in parts], 1)
        return hits.where((hits.distance >= lines.start[hits.pixel]) & (hits.distance <= lines.end[hits.pixel]))

    def _candidates(self, lines: Lines) -> tuple[Integers, Integers]:
        """Pairs (k,), (k,) of a line and a face, by rays in the ball of the mesh."""
        inverse = np.linalg.inv(self.body.matrix[:3, :3])
        with np.errstate(under="ignore"):
            origins = (
                lines.origins - point_from(self.embree.center, self.body.matrix, self.scene.camera.eye)
            ) @ inverse.T
            directions = lines.directions @ inverse.T
            directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        counted = np.ones(len(self.corners), dtype=bool)
        return self.embree.candidates(
            origins / self.embree.radius, directions, np.full(len(lines), MOST_FACES), counted
        )


#: Photons in the disc of each one: the noise of light at a point is 1.15 over the root of this number.
GATHERED = 64

#: Largest height of a photon over the plane of the point, in radii of its disc.
FLAT = 0.2

#: Least radius of a disc, as a fraction of the scene's diagonal.
LEAST_RADIUS = 1e-4

#: Factor between the largest and the smallest radius of discs that are looked for together.
TOGETHER = 1.5

#: Points at which light is gathered together.
BATCH = 1 << 14


class CausticLight(SurfaceLight):
    """Light on surfaces, with caustics of photons on opaque ones (Jensen 1996).

    The light of each photon is spread over a disc that holds so many of its neighbors (Breiman, Meisel & Purcell 1977,
    "Variable kernel estimates"). What the nearest photons of a point carry over the area that they lie in would, added
    up over all points, be more than they carry: far off a caustic it falls as slowly as the squared distance.

    Parameters
    ----------
    scene : Scene
        As rendered, with its eye as the origin of points.
    sheets, meshes
        As `EmbreeLightPaths` takes them.
    caustics : Caustics
    bending : frozenset of int
        Objects that straight light of lights does not pass, since photons carry it.
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
        """(k, 3): transmittance of straight light, 0 behind bodies that refract where it goes to opaque objects."""
        return self._dark.straight(light, points, before) if before == 0.0 else super().straight(light, points, before)

    def on_opaque(self, points: Array, normals: Array) -> Array:
        """Irradiance (k, 3) at points (k, 3) of opaque objects with unit normals (k, 3)."""
        return np.asarray(super().on_opaque(points, normals) + self._gathered(points, normals))

    def _gathered(self, points: Array, normals: Array) -> Array:
        """(k, 3): irradiance by photons whose discs contain the points."""
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
    directions: Array
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
        reached = (distance < 1.0) & (np.abs(height) < FLAT * self.radius[photon])
        reached &= (self.directions[photon] * normals[place]).sum(axis=1) < 0.0
        place, photon, distance = place[reached], photon[reached], distance[reached]
        with np.errstate(under="ignore"):
            # Those near the edge count less (Epanechnikov), so that no photon comes or goes at once.
            kernel = 2.0 * (1.0 - distance**2) / (np.pi * self.radius[photon] ** 2)
            light = kernel[:, None] * self.power[photon]
            return np.stack([np.bincount(place, light[:, channel], len(normals)) for channel in range(3)], axis=1)


def _discs(points: Array, directions: Array, power: Array, scene: Scene) -> list[_Discs]:
    """Discs of photons by their size."""
    if not len(points):
        return []
    points = points - scene.camera.eye
    radius = cKDTree(points).query(points, k=[min(GATHERED, len(points))])[0][:, 0]
    radius = np.maximum(radius, LEAST_RADIUS * scene.diagonal)
    size = np.floor(np.log(radius) / np.log(TOGETHER))
    kinds = [np.flatnonzero(size == one) for one in np.unique(size)]
    return [_Discs(points[own], directions[own], power[own], radius[own]) for own in kinds]


def _landed(scene: Scene, caustics: Caustics) -> tuple[Array, Array, Array]:
    """Points, directions and power (n, 3) of photons that land on opaque objects after interfaces."""
    parts = [np.zeros((3, 0, 3))]
    for segments in photon_segments(scene, caustics.photons, caustics.seed):
        ends = segments.where(segments.lands & segments.bent)
        points = ends.origins + ends.length[:, None] * ends.directions
        with np.errstate(under="ignore"):
            left = ends.power * optics.transmittance(ends.extinction * ends.length[:, None])
        parts.append(np.stack([points, ends.directions, left]))
    points, directions, power = np.concatenate(parts, axis=1)
    return points, directions, power


Arrays = dict[str, npt.NDArray[Any]]
Sheets = tuple[float | None, ...]

#: Surfaces, times objects, that are shaded at a time: the working arrays stay below 100 MB.
SURFACES = 1 << 21

#: Arrays that an invalid pixel takes from the fallback; its validity and coverage are known already.
RENDERED_IMAGES = ("radiance", "transmittance", "optical_depth", "thickness")


@dataclass(frozen=True, eq=False)
class Shader:
    """Shader of pixel hits into the arrays of a frame.

    Attributes
    ----------
    scene : Scene
    sheets : tuple of float or None
        Thickness in metres of the sheet that each object is; None for a solid.
    fallback : tuple of float or None, or None
        The same where a pixel is not valid, for scenes with bodies that are not closed.
    light : SurfaceLight
        On the surfaces of the scene.
    """

    scene: Scene
    sheets: Sheets
    fallback: Sheets | None
    light: SurfaceLight

    @classmethod
    def of(cls, scene: Scene, plan: RenderPlan, meshes: Mapping[Mesh, RayCaster]) -> Shader:
        """Shader for a plan of the scene; `meshes` are all of it, ready for rays."""
        sheets = sheet_thicknesses(scene, plan.method)
        drawn = {i for step in plan.passes if step.name is PassName.THIN_LAYER_FALLBACK for i in step.objects}
        diagonals = [float(np.linalg.norm(body.bounds[1] - body.bounds[0])) for body in scene.objects]
        fallback = tuple(
            FALLBACK_SHEET * diagonals[i] if i in drawn and metres is None else metres
            for i, metres in enumerate(sheets)
        )
        if plan.caustics is None:
            light = SurfaceLight(EmbreeLightPaths(scene, sheets, meshes))
        else:
            light = CausticLight(scene, sheets, meshes, plan.caustics, plan.opaque_to_shadows)
        return cls(scene, sheets, fallback if drawn else None, light)

    def shade(self, rays: Rays, hits: Sequence[Hits]) -> Arrays:
        """Shade some rays into the arrays of a frame, (n,) or (n, 3), float64 and bool.

        Parameters
        ----------
        rays : Rays
        hits : sequence of Hits
            Of each object of the scene, as `shade_hits` takes them.
        """
        surfaces = np.sum([np.bincount(line.pixel, minlength=len(rays)) for line in hits], axis=0)
        parts = []
        for some in slices(surfaces * len(hits), SURFACES):
            chosen = np.arange(some.start, some.stop)
            parts.append(self._shade(rays.where(some), [line.on_rays(chosen, len(rays)) for line in hits]))
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _shade(self, rays: Rays, hits: Sequence[Hits]) -> Arrays:
        shaded = shade_hits(self.scene, rays, hits, self.sheets, self.light)
        invalid = np.flatnonzero(~shaded["valid"])
        if self.fallback is not None and invalid.size:
            lines = [line.on_rays(invalid, len(rays)) for line in hits]
            again = shade_hits(self.scene, rays.where(invalid), lines, self.fallback, self.light)
            for name in RENDERED_IMAGES:
                shaded[name][invalid] = again[name]
        return shaded
