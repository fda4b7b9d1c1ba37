"""Optical properties of the interfaces of a scene, one row for each object, and how likely light escapes through them.

The CPU renderer and photons read the parameters of `translucent.formulas.bsdf` from it, as shaders do from the table of
objects on the GPU. `translucent.reference.interfaces` is independent of it.

References
----------
Case, de Hoffmann & Placzek 1953, "Introduction to the theory of neutron diffusion", for escape probabilities; Wigner et
al. 1955, "Review of the measurements of the resonance absorption of neutrons by uranium in bulk", for light that is
scattered again, if it is as likely to escape then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.formulas import optics
from translucent.formulas.bsdf import Interaction
from translucent.formulas.diffuse_interface import DiffuseInterface, diffuse_interface, exit_quadrature
from translucent.formulas.interface import channel_iors, reflected_direction
from translucent.geometry.ray_caster import ray_caster_of
from translucent.scene.scene import Object, Scene
from translucent.scene.surface import Surface

#: Index of no object: of a ray outside all bodies, and where a ray hits nothing.
AIR = -1


class InterfaceTable:
    """Optical properties of the objects of a scene. A row at index `AIR` stands behind those of the objects.

    Parameters
    ----------
    scene : Scene
    sheets : sequence of float or None
        Thickness in metres of the sheet that each object is; None for a solid.

    Attributes
    ----------
    iors : (objects + 1, 3) float64
        Index of refraction for each color of light.
    dispersed : bool
        Whether these differ in any body.
    is_opaque, is_solid, is_wall, is_film : (objects + 1,) bool
        Type of each object: without a medium, with one in a volume, a sheet with an interface, or one without.
    decides : (objects,) bool
        Whether its medium may be the effective one.
    rank : (objects,) int64
        Order of the priorities.
    transmission, color : (objects,), (objects, 3) float64
        Of the base.
    alpha, coat_roughness : (objects,) float64
        Width of the distribution of microfacets, and roughness of the clear coat.
    """

    def __init__(self, scene: Scene, sheets: Sequence[float | None]) -> None:
        self.scene, self.sheets = scene, sheets
        objects = scene.objects
        self.surfaces = [item.surface or Surface() for item in objects]
        media = [item.medium for item in objects]
        dispersion = self.column("dispersion")
        self.iors = np.vstack([channel_iors([m.ior if m else 1.0 for m in media], dispersion), np.ones(3)])
        filled = np.array([medium is not None for medium in media])
        self.dispersed = bool((dispersion[filled] > 0.0).any())
        thin = np.array([metres is not None for metres in sheets])
        bounded = np.array([item.has_interface for item in objects])
        self.is_opaque, self.is_solid, self.is_wall, self.is_film = (
            np.append(mask, False) for mask in (~filled, filled & ~thin, thin & bounded, filled & thin & ~bounded)
        )
        self.decides = self.is_solid[:-1] & (bounded | (scene.overlap == "priority"))
        self.rank = np.unique([item.priority for item in objects], return_inverse=True)[1].ravel()
        self.transmission, self.color = self.column("transmission"), self.column("color")
        self.alpha, self.coat_roughness = self.column("roughness") ** 2, self.column("clearcoat_roughness")
        self._plain = np.array([*(item.plain for item in objects), True])
        films = ("iridescence", "iridescence_ior", "iridescence_thickness")
        self._films = np.stack([self.column(name) for name in films], axis=1)
        self._coats = self.column("clearcoat")
        self._metres = np.array([metres or 0.0 for metres in sheets])
        self._extinction = np.array([np.zeros(3) if m is None else m.extinction for m in media], np.float64)
        self._emission = np.stack([scene.source(item) for item in objects])

    def column(self, name: str) -> Array:
        """(objects,) or (objects, 3): a parameter of the surfaces."""
        return np.array([getattr(surface, name) for surface in self.surfaces], np.float64)

    def alters_light(self, before: Integers, after: Integers, channel: Integers | int) -> Mask:
        """(k,): whether light changes where it passes from one effective medium to another."""
        differs = self.iors[before, channel] != self.iors[after, channel]
        return np.asarray((before != after) & (differs | ~self._plain[before] | ~self._plain[after]))

    def interfaces(
        self, item: Integers, before: Integers, after: Integers, changes: Mask, sheets: Mask
    ) -> tuple[Integers, Mask]:
        """Column (k,) of the object whose interface counts where several coincide, and whether (k,) it is a sheet.

        Parameters
        ----------
        item : (k, n) int64
            Objects in the place, or `AIR`.
        before, after : (k,) int64
            Effective media on this side, and on the other.
        changes : (k,) bool
            Whether there is an interface between these: it goes before a sheet in the same place.
        sheets : (objects + 1,) bool
            Objects that count as sheets.
        """
        is_sheet = sheets[item]
        sheet = ~changes & is_sheet.any(axis=1)
        # The interface is that of the body that the ray enters; if it enters none, of the one that it leaves.
        entered = (item == after[:, None]) & (item != AIR)
        column = np.where(entered.any(axis=1), entered.argmax(axis=1), (item == before[:, None]).argmax(axis=1))
        return np.where(sheet, is_sheet.argmax(axis=1), column), sheet

    def interaction(
        self,
        item: Integers,
        before: Integers,
        after: Integers,
        channel: Integers | int,
        direction: Array,
        normals: tuple[Array, Array],
    ) -> Interaction:
        """Interaction of light with interfaces of objects `item` (k,).

        Parameters
        ----------
        before, after : (k,) int64
            Effective media on this side, and on the other; equal at sheets.
        channel : int or (k,) int64
            Color of light whose indices of refraction count.
        direction : (k, 3) float64
        normals : (k, 3), (k, 3) float64
            For shading, and of the faces, towards the side that light comes from.
        """
        sheet = before == after
        ior_before = self.iors[before, channel]
        ior = np.where(self.is_film[item], 1.0, self.iors[np.where(sheet, item, after), channel] / ior_before)
        enters = sheet | (item == after)
        return Interaction(
            direction,
            *normals,
            ior,
            ior_before,
            self._films[item],
            np.where(enters, self._coats[item], 0.0),
            np.where(enters[:, None], self.color[item], 1.0) * self.transmission[item, None],
            sheet,
            self._metres[item],
            self._extinction[item],
            self._emission[item],
        )


@dataclass(frozen=True, eq=False)
class BodyInterface:
    """Interface between a body in which light diffuses and what is around it, as a whole and at each sample.

    Attributes
    ----------
    ior : float
        Index of the body relative to what is around most of it.
    outside : float
        Index of what is around most of it.
    main : DiffuseInterface
        Of that index.
    mirrored : float, or (s,) float64
        Flux that the surface reflects, for a unit of uniform light that enters.
    conductance, exit_share : float, or (s,) float64
        See `DiffuseInterface`.
    uniform : float, or (s,) float64
        Flux that enters in uniform light, over that where most of what is around is.
    brightness : float, or (s,) float64
        Factor for a surface whose light is looked up as if `main` was its interface.
    enclosed : bool
        Whether paths through the interfaces of clear bodies around it are followed, and on through the body.
    """

    ior: float
    outside: float
    main: DiffuseInterface
    mirrored: Array | float
    conductance: Array | float
    exit_share: Array | float
    uniform: Array | float = 1.0
    brightness: Array | float = 1.0
    enclosed: bool = False

    @classmethod
    def of(cls, ior: float, roughness: float, outside: Array | None = None) -> BodyInterface:
        """Interface of a medium of index `ior`; `outside` (s,) is the index around each sample, by default that of air.

        Without refraction uniform light has one L / n^2 in all media: where n is larger, more enters.
        """
        indices, at, count = (
            (np.ones(1), np.zeros(1, np.int64), np.ones(1))
            if outside is None
            else np.unique(outside, return_inverse=True, return_counts=True)
        )
        most = int(count.argmax())
        every = [diffuse_interface(ior / index, roughness) for index in indices]

        def each(values: list[float]) -> Array | float:
            return values[0] if len(values) == 1 else np.array(values)[at.ravel()]

        mirrored = [
            (1.0 - diffuse_interface(ior / index).entering) / one.entering
            for index, one in zip(indices, every, strict=True)
        ]
        sent = [index**2 * one.entering for index, one in zip(indices, every, strict=True)]
        # What is looked up is scaled to the flux through the main interface; through another one less is visible.
        seen = [
            one.exit_share / float(exit_quadrature(ior / index)[1].sum())
            for index, one in zip(indices, every, strict=True)
        ]
        return cls(
            ior / float(indices[most]),
            float(indices[most]),
            every[most],
            each(mirrored),
            each([one.conductance for one in every]),
            each([one.exit_share for one in every]),
            each([one / sent[most] for one in sent]),
            each([one / seen[most] for one in seen]),
            outside is not None,
        )


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
