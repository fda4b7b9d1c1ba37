"""Probability that light which a medium sends out leaves a body without another event.

References
----------
Case, de Hoffmann & Placzek 1953, "Introduction to the theory of neutron diffusion", for escape probabilities; Wigner et
al. 1955, "Review of the measurements of the resonance absorption of neutrons by uranium in bulk", for light that is
scattered again, if it is as likely to escape then.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array
from translucent.formulas import optics
from translucent.formulas.interface import reflected_direction
from translucent.geometry.ray_caster import ray_caster_of
from translucent.scene.scene import Object

#: Paths, and how often they are followed where they are reflected: what goes around then counts as absorbed.
PATHS, REFLECTIONS = 4096, 12


@dataclass(frozen=True, eq=False)
class EscapePaths:
    """Paths from places that are spread evenly over a body, in even directions, through its polished surface.

    Attributes
    ----------
    chords : (k,) float64
        Length of the chord that each path begins on, anywhere.
    metres : (r, k) float64
        From the end of the chord to where the path meets the surface, there and after each reflection.
    leaving : (r, k) float64
        Fraction of the light of each that leaves there, if the medium takes none; of all paths together 1, or less.
    """

    chords: Array
    metres: Array
    leaving: Array

    @classmethod
    def of(cls, body: Object, starts: Array, inwards: Array, ior: float) -> EscapePaths:
        """Paths on chords of a body from `starts` (s, 3) somewhat below its surface, in directions `inwards` (s, 3).

        These are even in flux (Lambert). So chords come with the density of all lines, and places on them, weighted by
        their length, are even in the volume, and lines in them in all directions (Cauchy 1850).
        """
        part = np.unique(np.linspace(0, len(starts) - 1, PATHS).astype(np.int64))
        origin, direction = starts[part], inwards[part]
        matrix, into = body.matrix[:3, :3], np.linalg.inv(body.matrix)
        caster, corners = ray_caster_of(body.mesh), body.mesh.vertices[body.mesh.faces] @ matrix.T
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        left: Array = np.ones(len(part))
        metres: Array = np.zeros(len(part))
        chords = metres
        every_metre, leaving = list[Array](), list[Array]()
        for bounce in range(REFLECTIONS):
            face, found = caster.nearest(origin @ into[:3, :3].T + into[:3, 3], direction @ into[:3, :3].T)
            hit = face >= 0
            distance = np.where(hit, found, 0.0)
            if bounce == 0:
                # The mean chord is 4 V / S (Cauchy).
                chords, left = distance, np.asarray(distance / (2.0 * body.mean_thickness * len(part)))
            else:
                metres = np.asarray(metres + distance)
            along = (normals[face] * direction).sum(axis=1)
            normal = np.where(along < 0.0, -1.0, 1.0)[:, None] * normals[face]
            reflected = np.where(hit, optics.fresnel_dielectric(np.abs(along), 1.0 / ior), 0.0)
            every_metre.append(metres)
            leaving.append(left * (1.0 - reflected))
            left = np.asarray(left * reflected)
            origin = origin + distance[:, None] * direction - _BELOW * body.mesh.diagonal * normal
            direction = reflected_direction(direction, normal)
        return cls(chords, np.stack(every_metre), np.stack(leaving))

    def probability(self, extinction: float) -> float:
        """Fraction that leaves without an event, for an even extinction in 1/m."""
        first = optics.mean_transmittance(extinction * self.chords)
        return min(float((self.leaving * first * optics.transmittance(extinction * self.metres)).sum()), 1.0)


#: Distance below the surface at which reflected paths begin, in diagonals of the mesh.
_BELOW = 1e-6


def scattered_escape(escape: float, albedo: float) -> float:
    """Fraction of the light sent out in a body that leaves it at last, if a fraction `escape` does without an event.

    After each event it is as likely: e + (1 - e) w e + ..., w the albedo. That holds where events are as even as the
    medium, so in thin bodies, and as long as little is absorbed.
    """
    return escape / (escape + (1.0 - escape) * (1.0 - albedo)) if escape > 0.0 else 0.0
