"""Optical properties of the interfaces of a scene, one row for each object.

The CPU renderer and photons read the parameters of `translucent.formulas.bsdf` from it, as shaders do from the table of
objects on the GPU. `translucent.reference.interfaces` is independent of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from translucent.arrays import Array, Integers, Mask
from translucent.formulas.bsdf import Interaction
from translucent.formulas.interface import channel_iors
from translucent.scene.scene import Scene
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
