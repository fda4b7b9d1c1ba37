"""Light paths whose surfaces Embree finds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from translucent.arrays import Integers
from translucent.cpu.threads import end_if_stopped
from translucent.geometry.mesh import Mesh
from translucent.geometry.ray_caster import RayCaster, point_from
from translucent.reference.hits import Hits, sorted_hits
from translucent.reference.intervals import sum_signs
from translucent.reference.light_paths import LightPaths
from translucent.reference.tracer import Lines, TracedObject, Tracer
from translucent.scene.scene import Scene

#: Number of faces of one object on a line after which Embree is not asked for more.
MOST_FACES = 64


class EmbreeLightPaths(LightPaths):
    """Light paths as the reference has them, on surfaces that Embree finds and float64 places.

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
    def tracer(self) -> Tracer:
        """Ray caster for the objects."""
        found = Tracer(self.scene)
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
        tried, met = (np.bincount(pixel, minlength=len(lines)) for pixel in (line, hits.pixel))
        doubtful = (tried != met) | (tried >= MOST_FACES)
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
